//! Every hostile file gives a typed error of the expected kind, within two seconds and with little memory. The files are in
//! `corpus/`; `cargo test -p litetex-exporters --test corpus -- --ignored` regenerates them.

#[path = "common/mod.rs"]
mod common;
#[path = "common/hostile.rs"]
mod hostile;
#[path = "common/measured.rs"]
mod measured;

use hostile::{Expect, File};
use litetex_exporters::{Contents, Error, ReadLimits, Severity, read_asset, read_fallback, validate_file};
use measured::{bytes_max, measured};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

/// Only one test can measure at a time.
static MEASURING: Mutex<()> = Mutex::new(());

/// Memory that any file of the corpus may take, below 100 KB each.
const BYTES_MAX: usize = 64 << 20;

/// Time for each step; most take milliseconds.
const TIME_MAX: Duration = Duration::from_secs(2);

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus")
}

fn kind(read: &Result<Contents, Error>) -> Option<Expect> {
    match read {
        Ok(_) => Some(Expect::Reads),
        Err(Error::Invalid { .. }) => Some(Expect::Invalid),
        Err(Error::Unsupported { .. }) => Some(Expect::Unsupported),
        Err(Error::TooLarge { .. }) => Some(Expect::TooLarge),
        // Sidecar files that are missing, and nothing else.
        Err(Error::Io { .. }) => None,
        Err(_) => None,
    }
}

fn check(path: &Path, expect: Expect) -> usize {
    let name = path.display();
    let (read, bytes, time) = measured(|| read_asset(path, &ReadLimits::default()));
    assert!(bytes <= BYTES_MAX && time < TIME_MAX, "{name}: {bytes} bytes, {time:?}");
    match kind(&read) {
        Some(found) => assert_eq!(found, expect, "{name}: {:?}", read.err()),
        None => {
            assert!(name.to_string().contains("missing_") || name.to_string().contains("leaves"), "{read:?}")
        }
    }
    if let Ok(contents) = read {
        contents.asset.validate().expect("what is read is valid");
    }
    let (issues, more, time) = measured(|| validate_file(path));
    assert!(more <= BYTES_MAX && time < TIME_MAX, "{name}: {more} bytes, {time:?} to validate");
    let issues = issues.expect("the file is there");
    let has_errors = issues.iter().any(|i| i.severity == Severity::Error);
    let may_be_silent = expect == Expect::Reads || expect == Expect::Unsupported;
    assert!(has_errors || may_be_silent, "{name}: {issues:?}");
    let (_, fallback, time) = measured(|| drop(read_fallback(path, &ReadLimits::default())));
    assert!(fallback <= BYTES_MAX && time < TIME_MAX, "{name}: {fallback} bytes, {time:?} for its fallback");
    bytes.max(more).max(fallback)
}

#[test]
fn every_corpus_file_gives_the_expected_outcome() {
    let _guard = MEASURING.lock();
    let files = hostile::all();
    let mut stored: Vec<String> = std::fs::read_dir(folder())
        .expect("the corpus")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    stored.sort();
    let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(stored, names, "regenerated with --ignored?");
    let mut worst = (0, "");
    for File { name, expect, bytes } in &files {
        let path = folder().join(name);
        assert!(
            std::fs::read(&path).expect("read") == *bytes,
            "{name} differs from the generator's: regenerate it"
        );
        let bytes = check(&path, *expect);
        worst = worst.max((bytes, name));
    }
    println!("{} files, at most {worst:?}", files.len());
}

#[test]
fn validation_reports_oddities_that_readers_accept() {
    let codes = |name: &str| -> Vec<&str> {
        validate_file(&folder().join(name)).expect("looked at").iter().map(|i| i.code).collect()
    };
    for (name, code) in [
        ("overlapping_maps.glb", "LT1023"),
        ("wrong_colours_for_others.glb", "LT1031"),
        ("nan_colours_for_others.glb", "LT1029"),
        ("thick_for_others.glb", "LT1032"),
        ("long_quaternion.ply", "LT4004"),
        ("bytes_behind.ply", "LT4011"),
        ("damaged_metadata.spz", "LT4010"),
        ("newer_minor_version.ltgs", "LT3007"),
    ] {
        assert!(codes(name).contains(&code), "{name}: {:?}", codes(name));
    }
}

/// Measured, bytes of memory by bytes of the file (`--nocapture` prints it):
///
/// | format | what | file | to read | to validate |
/// |---|---|---|---|---|
/// | spz | splats of zeros | 0.6 KB | 77 MB | 77 MB |
/// | ply | properties of a byte | 581 KB | 3 MB | 3 MB |
/// | glb | a page of neutral texels | 19 KB | 50 MB | 50 MB |
/// | ltgs | neutral texels | 1 KB | 25 MB | 25 MB |
/// | ltgs | more neutral texels than any scene | 7 KB | refused | |
/// | ltgs | rounded neutral texels | 3 KB | 100 MB | 100 MB |
/// | glb | a page of 4096 for few texels | 62 KB | 0 MB | 2 MB |
/// | glb | a page of 8192 for few texels | 219 KB | refused | |
/// | glb | JSON of empty nodes | 393 KB | 58 MB | 97 MB |
/// | glb | JSON of numbers | 1003 KB | 4 MB | 6 MB |
/// | usda | text of prims | 350 KB | 19 MB | 19 MB |
/// | usda | text of properties | 538 KB | 17 MB | 17 MB |
/// | usda | text of numbers | 400 KB | 3 MB | 3 MB |
/// | usda | text of entries | 400 KB | 7 MB | 7 MB |
/// | usdz | a page of neutral texels | 9 KB | 13 MB | 13 MB |
///
/// [`ReadLimits::of_file`] bounds all of them: arrays of 64 MiB for the smallest file.
#[test]
fn small_files_take_bounded_memory_and_time() {
    let _guard = MEASURING.lock();
    let folder = tempfile::tempdir().expect("a folder");
    for (what, name, bytes) in hostile::greedy() {
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).expect("written");
        let (_, read, time) = measured(|| drop(read_asset(&path, &ReadLimits::default())));
        let (_, looked, more) = measured(|| drop(validate_file(&path)));
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        println!(
            "| {extension} | {what} | {} KB | {} MB | {} MB | {time:.1?} {more:.1?}",
            bytes.len() / 1000,
            read / 1_000_000,
            looked / 1_000_000
        );
        assert!(read.max(looked) < bytes_max(bytes.len()), "{what}: {read}, {looked}");
        assert!(time.max(more) < TIME_MAX, "{what}: {time:?}, {more:?}");
    }
}

#[test]
#[ignore = "writes the corpus"]
fn write_the_corpus() {
    let _ = std::fs::remove_dir_all(folder());
    std::fs::create_dir_all(folder()).expect("made");
    let mut total = 0;
    for File { name, bytes, .. } in hostile::all() {
        total += bytes.len();
        std::fs::write(folder().join(name), bytes).expect("written");
    }
    assert!(total < 280_000, "{total} bytes");
    println!("{total} bytes");
}
