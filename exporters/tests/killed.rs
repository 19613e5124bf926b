//! A process killed while it replaces a multi-file asset leaves the old asset, the new one, or files that readers refuse.

mod common;

use litetex_exporters::{Quality, ReadLimits, SplatAsset, WriteOptions, read_asset, write_asset};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Names the file that the child process replaces again and again.
const TARGET: &str = "LITETEX_KILLED_TARGET";

fn scene(title: &str) -> SplatAsset {
    let mut asset = common::scene(40, 0);
    asset.provenance.title = title.to_owned();
    asset.texels.iter_mut().step_by(3).for_each(|t| *t *= 1.0 / title.len() as f32);
    asset
}

fn write(path: &Path, title: &str) {
    let options = WriteOptions { quality: Quality::Balanced, mesh: true, ..WriteOptions::default() };
    write_asset(path, &scene(title), &options).expect("written");
}

#[test]
#[ignore = "the child of the other test"]
fn replace_for_ever() {
    let path = PathBuf::from(std::env::var_os(TARGET).expect("called by the other test"));
    for title in ["a", "bb"].iter().cycle() {
        write(&path, title);
    }
}

#[test]
fn assets_stay_complete_after_kills() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.gltf");
    write(&path, "a");
    let mut left_behind = 0;
    for round in 0..20 {
        let mut child = Command::new(std::env::current_exe().expect("this program"))
            .args(["--ignored", "--exact", "replace_for_ever"])
            .env(TARGET, &path)
            .stdout(std::process::Stdio::null())
            .spawn()
            .expect("started");
        std::thread::sleep(Duration::from_millis(60 + 7 * round));
        child.kill().expect("killed");
        child.wait().expect("ended");
        let is_staging = |e: &std::fs::DirEntry| e.path().extension().is_some_and(|e| e == "part");
        left_behind += std::fs::read_dir(folder.path()).expect("read").flatten().filter(is_staging).count();
        match read_asset(&path, &ReadLimits::default()) {
            Ok(contents) => {
                let is_whole = contents.hash == Some(contents.asset.hash());
                assert!(is_whole, "round {round}: files of two assets are mixed");
                assert!(["a", "bb"].contains(&contents.asset.provenance.title.as_str()));
            }
            Err(error) => assert!(error.to_string().contains("export the scene again"), "{error}"),
        }
        write(&path, "a");
    }
    assert!(left_behind > 0, "negative control: no kill met an export");
}
