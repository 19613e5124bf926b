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
        let train = "--steps 300 --device cpu --set background=#808080 --set backdrop=none --init sfm --set max-points=60 \
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
fn models_that_are_good_enough_merge_neighbours_unless_a_budget_binds() {
    let dir = tempfile::tempdir().unwrap();
    let train = wall(dir.path());
    type Sum = (u64, u64, f64, u64);
    // Splats merged in all rounds, and parameters of the models, of three runs together; the lowest PSNR and the largest model.
    let merged = |words: &str| {
        let run = |seed: u32| {
            let summary = train(&format!("--seed {seed} {words}"));
            let rounds = summary["pruned"].as_array().unwrap();
            let merged: u64 = rounds.iter().map(|round| round["merged"].as_u64().unwrap()).sum();
            let params = summary["size"]["params"].as_u64().unwrap();
            (merged, params, summary["quality"]["psnr"].as_f64().unwrap(), params)
        };
        let sum = |a: Sum, b: Sum| (a.0 + b.0, a.1 + b.1, a.2.min(b.2), a.3.max(b.3));
        (1..=3).map(run).reduce(sum).unwrap()
    };
    let (count, params, psnr, _) = merged("--set density.merge=true");
    assert!(count > 30 && psnr > 40.0, "{count} splats, {psnr} dB");
    // Negative controls: rounds that may not merge, a bar that the model does not reach, and a budget.
    let (count, unmerged, ..) = merged("--set density.merge=false");
    assert!(count == 0 && 3 * unmerged > 4 * params, "{unmerged} and {params} parameters");
    assert_eq!(merged("--set density.floor-db=80").0, 0);
    let (count, _, _, largest) = merged("--budget-params 900");
    assert!(count == 0 && largest <= 900, "{count}, {largest}");
}

#[test]
fn a_model_within_its_budget_is_pruned_by_need_only() {
    let dir = tempfile::tempdir().unwrap();
    let train = wall(dir.path());
    let pruned = |words: &str| train(&format!("--seed 1 {words}"))["pruned"].as_array().unwrap().clone();
    let within = pruned("--need 0.05 --budget-params 1M");
    assert!(
        within.iter().any(|round| round["params"].as_u64() < round["params_before"].as_u64()),
        "{within:?}"
    );
    assert!(pruned("--budget-params 1M").is_empty());
}
