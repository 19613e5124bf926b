//! `litetex export scene.html`: one file that holds the page and the scene, and is read like any other format.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::assets::asset;
use common::cli::{bad, good, json, text};
use litetex_exporters::html::{self, Page, Place};
use litetex_exporters::{Quality, ReadLimits, WriteOptions, ltgs, read_asset, write_asset};
use std::path::{Path, PathBuf};

/// Bytes that the page may add to its scene in base64.
const PAGE_BYTES_MAX: usize = 250_000;

const TITLE: &str = "</title></script><script>alert(1)</script> <!-- \"' &amp;";

/// A folder with a lossless `.ltgs` file of hostile names.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (path, mut asset) = (folder.path().join("scene.ltgs"), asset());
    asset.provenance.title = "Scene".to_owned();
    asset.cameras[0].name = TITLE.to_owned();
    write_asset(&path, &asset, &WriteOptions { quality: Quality::Lossless, ..WriteOptions::default() })
        .unwrap();
    (folder, path)
}

fn pages_ltgs(path: &Path) -> Vec<u8> {
    html::embedded(&std::fs::read(path).unwrap(), path).unwrap()
}

#[test]
fn a_page_holds_what_a_compact_file_holds() {
    let (folder, scene) = folder();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    for quality in ["lossless", "balanced", "tiny"] {
        let (page, compact) = (at(&format!("{quality}.html")), at(&format!("{quality}.ltgs")));
        let args =
            ["export", text(&scene), "-o", &page, &compact, "--quality", quality, "--device", "cpu", "-q"];
        let table = good(&args);
        assert!(table.matches(" yes").count() == 2, "{table}");
        let (bytes, inside) = (std::fs::read(&page).unwrap(), pages_ltgs(Path::new(&page)));
        assert!(inside == std::fs::read(&compact).unwrap(), "{quality}: the same search, the same file");
        assert!(bytes.len() <= inside.len().div_ceil(3) * 4 + PAGE_BYTES_MAX, "{} bytes", bytes.len());
        let policy = Page::embedded().policy(Place::File);
        assert!(String::from_utf8(bytes).unwrap().contains(&policy) && !policy.contains("connect-src"));
        // Read as any other format.
        assert_eq!(json(&["validate", &page])["valid"], json(&["validate", &compact])["valid"]);
        let inspected = json(&["inspect", &page]);
        assert!(inspected["format"].as_str().unwrap().starts_with("HTML with "), "{inspected}");
        assert_eq!(inspected["quality"], quality);
        good(&["verify", &page, "--against", text(&scene), "--device", "cpu", "-q"]);
    }
    let again = at("again.ltgs");
    good(&["convert", &at("lossless.html"), &again, "--quality", "lossless", "--device", "cpu", "-q"]);
    assert!(std::fs::read(&again).unwrap() == std::fs::read(&scene).unwrap());
    let images = at("images");
    good(&[
        "render",
        &at("tiny.html"),
        "--orbit",
        "2",
        "-o",
        &images,
        "--size",
        "32",
        "--device",
        "cpu",
        "-q",
    ]);
    assert_eq!(std::fs::read_dir(images).unwrap().count(), 2);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().starts_with('.')), "{left:?}");
}

#[test]
fn titles_stay_text() {
    let (folder, scene) = folder();
    let page = folder.path().join("page.html");
    let args =
        ["export", text(&scene), "-o", text(&page), "--title", TITLE, "--author", TITLE, "--licence", TITLE];
    good(&[&args[..], &["--source", TITLE, "--no-verify", "-q"]].concat());
    let bytes = String::from_utf8(std::fs::read(&page).unwrap()).unwrap();
    assert!(!bytes.contains("alert(1)</script>") && !bytes.contains("<!-- \""), "nothing is unescaped");
    assert!(bytes.contains("<title>&lt;/title&gt;"), "negative control: the title is there");
    let read = read_asset(&page, &ReadLimits::default()).unwrap().asset;
    assert_eq!((&*read.provenance.title, &*read.provenance.author), (TITLE, TITLE));
    let inside = ltgs::decode(&pages_ltgs(&page), &page, &ReadLimits::default()).unwrap();
    assert_eq!(inside.asset.hash(), read.hash());
}

#[test]
fn what_is_no_scene_is_refused() {
    let (folder, scene) = folder();
    let foreign = folder.path().join("foreign.html");
    std::fs::write(&foreign, "<!doctype html><title>Mine</title>").unwrap();
    for args in [&["inspect", text(&foreign)][..], &["convert", text(&foreign), "x.ltgs"]] {
        let (code, message) = bad(args);
        assert!(code == 3 && message.contains("not an exported scene"), "{code} {message}");
    }
    let (code, _) = bad(&["validate", text(&foreign)]);
    assert_eq!(code, 1);
    // Nothing is replaced unasked.
    let (code, message) = bad(&["export", text(&scene), "-o", text(&foreign), "--no-verify"]);
    assert!(code == 2 && message.contains("--force"), "{message}");
    let page = folder.path().join("a.html");
    for (option, value) in [("--mesh", None), ("--max-size", Some("5kB"))] {
        let args = [&["export", text(&scene), "-o", text(&page), option][..], value.as_slice()].concat();
        let (code, message) = bad(&args);
        assert!(code == 2 && message.contains(option), "{option}: {code} {message}");
    }
}
