//! What need and budgets do to a wall whose smallest model is known. The suite is in `lab/tests/need.rs`.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("litetex").unwrap().args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

/// A wall in a folder, and a training of it with these arguments, given as words; returns the summary.
fn wall(dir: &Path) -> impl Fn(&str) -> Value {
    let path = |name: &str| dir.join(name).to_str().unwrap().to_owned();
    let (capture, split, out) = (path("wall"), path("wall/test.txt"), path("run"));
    let sample = "--scene wall:4 --views 12 --size 64x48 --rays 2 --points 150 --no-truth -q";
    let arguments: Vec<&str> = ["sample", &capture].into_iter().chain(sample.split(' ')).collect();
    assert_eq!(run(&arguments).0, 0);
    move |words: &str| {
        let train = "--steps 300 --seed 1 --device cpu --background #808080 --set backdrop=none --init sfm --set max-points=60 \
                     --force -q";
        let arguments: Vec<&str> = ["train", &capture, "-o", &out, "--test-list", &split]
            .into_iter()
            .chain(train.split_ascii_whitespace())
            .chain(words.split_ascii_whitespace())
            .collect();
        let (code, _, stderr) = run(&arguments);
        assert_eq!(code, 0, "{stderr}");
        let summary = fs::read_to_string(Path::new(&out).join("summary.json")).unwrap();
        serde_json::from_str(&summary).unwrap()
    }
}

#[test]
fn models_merge_on_the_way_to_their_budget_and_no_further() {
    let dir = tempfile::tempdir().unwrap();
    let train = wall(dir.path());
    // Splats merged in each round, parameters after it, and those of the model.
    let merged = |merge: &str| {
        let summary = train(&format!("--budget-params 900 --set {merge}"));
        assert!(summary["size"]["params"].as_u64().unwrap() <= 900, "{summary}");
        let rounds = summary["pruned"].as_array().unwrap();
        let of = |round: &Value| ["merged", "params"].map(|key| round[key].as_u64().unwrap());
        rounds.iter().map(of).collect::<Vec<_>>()
    };
    let [first, last] = merged("density.merge=true")[..] else { panic!("expected two rounds") };
    assert!(first[0] > 5 && first[1] >= 900, "{first:?}");
    assert!(last[0] == 0 && last[1] <= 900, "{last:?}");
    // Negative control: rounds that may not merge.
    let without = merged("density.merge=false");
    assert!(without.iter().all(|[merged, _]| *merged == 0) && without[0][1] > first[1], "{without:?}");
}

#[test]
fn a_model_within_its_budget_gives_back_by_need_only() {
    let dir = tempfile::tempdir().unwrap();
    let train = wall(dir.path());
    let pruned = |words: &str| train(words)["pruned"].as_array().unwrap().clone();
    let within = pruned("--need 0.05 --budget-params 1M");
    assert!(
        within.iter().all(|round| round["params"].as_u64() < round["params_before"].as_u64()),
        "{within:?}"
    );
    assert!(!within.is_empty());
    assert_eq!(within, pruned("--need 0.05"), "a budget that does not bind changes nothing");
    assert!(pruned("--budget-params 1M").is_empty());
}
