//! `litetex view`: what the page gets, and who else gets nothing.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::assets::asset;
use common::cli::{bad, good, text};
use common::page::Page;
use litetex_exporters::html::{self, Place};
use litetex_exporters::{Quality, ReadLimits, SplatAsset, WriteOptions, ltgs, write_asset};
use serde_json::json;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Much less than a client that sends nothing is waited for.
const SOON: Duration = Duration::from_secs(3);

fn written(folder: &Path, name: &str) -> (PathBuf, SplatAsset) {
    let (path, mut asset) = (folder.join(name), asset());
    asset.provenance.title = "A </script> & \"title\"".to_owned();
    write_asset(&path, &asset, &WriteOptions { quality: Quality::Lossless, ..WriteOptions::default() })
        .unwrap();
    (path, asset)
}

fn view(path: &Path) -> Page {
    Page::start(&["view", text(path), "--no-open"])
}

/// The scene that the page gets.
fn served(page: &Page) -> SplatAsset {
    let bytes = page.data("asset").body;
    ltgs::decode(&bytes, Path::new("served"), &ReadLimits::default()).unwrap().asset
}

#[test]
fn a_file_is_served_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let (path, asset) = written(folder.path(), "scene.ltgs");
    let page = view(&path);
    let session = page.session();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(session["schema"], "litetex-view/1");
    assert_eq!(session["title"], asset.provenance.title);
    assert_eq!(session["program"], concat!("litetex ", env!("CARGO_PKG_VERSION")));
    let url = format!("/{}/asset", page.token);
    let expected =
        json!({ "url": url, "bytes": bytes.len(), "format": "ltgs", "name": "scene.ltgs", "revision": 1 });
    assert_eq!(session["asset"], expected);
    for none in ["photos", "training"] {
        assert!(session[none].is_null(), "{none}");
    }
    let answer = page.data("asset");
    assert_eq!(
        (answer.status, answer.header("content-length")),
        (200, Some(bytes.len().to_string().as_str()))
    );
    assert!(answer.body == bytes);
    let head = page.request("HEAD", &url, "");
    assert_eq!((head.status, head.body.len()), (200, 0));
    assert_eq!(head.header("content-length"), answer.header("content-length"));
    assert_eq!(page.data("photo/0").status, 404);
    // Written again, it is shown again.
    let other = asset.untextured();
    write_asset(&path, &other, &WriteOptions { quality: Quality::Lossless, ..WriteOptions::default() })
        .unwrap();
    page.wait_for("the new file", |session| session["asset"]["revision"] == 2);
    assert!(served(&page).hash() == other.hash() && other.hash() != asset.hash());
    // What is no scene is not.
    std::fs::write(&path, "LTGS").unwrap();
    std::thread::sleep(SOON);
    assert_eq!(page.session()["asset"]["revision"], 2);
}

#[test]
fn other_formats_are_served_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["scene.usda", "scene.gltf", "scene.html"] {
        let (path, asset) = written(folder.path(), name);
        let page = view(&path);
        assert_eq!(page.session()["asset"]["format"], "ltgs", "{name}");
        assert_eq!(served(&page).hash(), asset.hash(), "{name}");
    }
    let (path, _) = written(folder.path(), "scene.glb");
    let page = view(&path);
    assert_eq!(page.session()["asset"]["format"], "glb");
    assert!(page.data("asset").body == std::fs::read(&path).unwrap());
    // Splats of other programs, too.
    let (path, asset) = written(folder.path(), "scene.ply");
    assert_eq!(served(&view(&path)).num_splats(), asset.num_splats());
}

#[test]
fn the_page_may_do_nothing_but_draw() {
    let page = Page::start(&["view", "--no-open"]);
    let answer = page.request("GET", "/", "Sec-Fetch-Site: none\r\n");
    assert_eq!((answer.status, answer.header("content-type")), (200, Some("text/html; charset=utf-8")));
    let body = String::from_utf8(answer.body.clone()).unwrap();
    let policy = html::Page::new(&body).policy(Place::Server);
    assert_eq!(answer.header("content-security-policy"), Some(policy.as_str()));
    assert!(policy.contains("'sha256-") && policy.contains("connect-src 'self'"), "{policy}");
    // Negative control: a changed script would not run.
    assert_ne!(html::Page::new(&body.replace("</script>", ";</script>")).policy(Place::Server), policy);
    assert!(!body.contains(&page.token), "the page holds no data");
    let icon = page.request("GET", "/favicon.ico", "");
    assert_eq!((icon.status, icon.header("content-type")), (200, Some("image/svg+xml")));
    // Without a file there is nothing to get.
    assert!(page.session()["asset"].is_null());
    assert_eq!(page.data("asset").status, 404);
    for answer in
        [answer, icon, page.data("session.json"), page.data("asset"), page.request("GET", "/no", "")]
    {
        for (name, value) in [
            ("cache-control", "no-store"),
            ("x-content-type-options", "nosniff"),
            ("referrer-policy", "no-referrer"),
            ("cross-origin-resource-policy", "same-origin"),
            ("cross-origin-opener-policy", "same-origin"),
        ] {
            assert_eq!(answer.header(name), Some(value), "{}", answer.headers);
        }
        let headers = answer.headers.to_ascii_lowercase();
        assert!(headers.contains("default-src 'none'"), "{headers}");
        assert!(!headers.contains("access-control"), "{headers}");
    }
}

#[test]
fn requests_of_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), "scene.ltgs");
    let page = view(&path);
    let asset = format!("/{}/asset", page.token);
    let with = |headers: &str| page.request("GET", &asset, headers).status;
    assert_eq!(with(""), 200, "negative control");
    assert_eq!(with(&format!("Origin: http://{}\r\nSec-Fetch-Site: same-origin\r\n", page.address)), 200);
    for headers in [
        "Origin: http://evil.example\r\n",
        "Origin: null\r\n",
        "Sec-Fetch-Site: cross-site\r\n",
        "Sec-Fetch-Site: same-site\r\n",
    ] {
        assert_eq!(with(headers), 403, "{headers}");
        assert_eq!(page.request("GET", "/", headers).status, 403, "the page, too: {headers}");
    }
    let port = page.address.rsplit(':').next().unwrap();
    let named = |host: &str| page.raw(&format!("GET {asset} HTTP/1.1\r\nHost: {host}\r\n\r\n")).status;
    assert_eq!(named(&format!("localhost:{port}")), 200);
    for host in ["evil.example", &format!("evil.example:{port}"), "127.0.0.1", "127.0.0.1:1"] {
        assert_eq!(named(host), 421, "{host}");
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH"] {
        let answer = page.request(method, &asset, "");
        assert_eq!((answer.status, answer.header("allow")), (405, Some("GET, HEAD")), "{method}");
    }
    let wrong = page.token.replace(|c: char| c.is_ascii_digit(), "a");
    for (path, status) in [
        (format!("/{wrong}/asset"), 403),
        ("/0/asset".to_owned(), 403),
        ("/asset".to_owned(), 404),
        ("/session.json".to_owned(), 404),
        (format!("//{}/asset", page.token), 403),
        (format!("/{}/", page.token), 404),
        (format!("/{}/asset/", page.token), 404),
        (format!("/{}/photo/-1", page.token), 404),
        (format!("/{}/photo/99999999999999999999999", page.token), 404),
        (format!("/{}/../../../../etc/passwd", page.token), 404),
        (format!("/{}/%2e%2e/%2e%2e/etc/passwd", page.token), 404),
        (format!("/{}/{}", page.token, text(&path)), 404),
        ("/../../../../etc/passwd".to_owned(), 403),
    ] {
        assert_eq!(page.request("GET", &path, "").status, status, "{path}");
    }
    assert_eq!(with(&format!("X: {}\r\n", "x".repeat(20_000))), 431);
    assert_eq!(with(&"X: x\r\n".repeat(100)), 431);
    assert_eq!(page.raw(&format!("GET /{} HTTP/1.1\r\n\r\n", "x".repeat(20_000))).status, 431);
    assert_eq!(page.raw("nonsense\r\n\r\n").status, 400);
    assert_eq!(page.raw("GET / HTTP/1.1\r\n\r\n").status, 400, "no host");
    assert_eq!(with(""), 200, "still there");
}

#[test]
fn clients_that_send_or_take_nothing_do_not_block_others() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = written(folder.path(), "scene.ltgs");
    let page = view(&path);
    let mut silent: Vec<_> = (0..100).map(|_| page.connect()).collect();
    for stream in silent.iter_mut().skip(50) {
        // Half a request; some are closed already.
        let _ = stream.write_all(b"GET / HTTP/1.1\r\n");
    }
    let began = Instant::now();
    for _ in 0..5 {
        assert_eq!(page.data("session.json").status, 200);
    }
    assert!(began.elapsed() < SOON, "{:?}", began.elapsed());
    // In the end, they are told or closed.
    let mut answer = String::new();
    let last = silent.last_mut().unwrap();
    last.read_to_string(&mut answer).unwrap();
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 408"), "{answer}");
}

#[test]
fn clients_that_send_on_do_not_block_others() {
    let page = Page::start(&["view", "--no-open"]);
    let mut clients: Vec<_> = (0..40).map(|_| page.connect()).collect();
    for client in &mut clients {
        let _ = client.write_all(b"GET /favicon.ico HTTP/1.1\r\nHost: localhost\r\n\r\n");
    }
    // Byte by byte, for longer than a client is listened to after its answer.
    let began = Instant::now();
    while began.elapsed() < Duration::from_millis(1500) {
        clients.iter_mut().for_each(|client| drop(client.write_all(b"x")));
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(page.data("session.json").status, 200);
}

/// What is in a run folder from elsewhere.
#[cfg(unix)]
fn check_a_run_from_elsewhere(folder: &Path, run: &Path) {
    let secret = folder.join("secret");
    std::fs::write(&secret, "not for the page").unwrap();
    std::os::unix::fs::symlink(&secret, run.join("preview.ltgs")).unwrap();
    std::fs::remove_file(run.join("metrics.jsonl")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(run.join("metrics.jsonl")).status().unwrap();
    assert!(made.success());
    let page = view(run);
    assert!(page.session()["training"].is_null());
    assert!(page.data("asset").body.starts_with(b"LTGS"));
}

#[test]
fn a_run_is_shown_with_its_photos() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    let (capture, run) = (at("capture"), at("run"));
    good(&["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
    let train =
        ["train", &capture, "-o", &run, "--device", "cpu", "-q", "--steps", "30", "--set", "eval-every=10"];
    good(&train);
    let page = view(Path::new(&run));
    let session = page.session();
    assert_eq!((&session["title"], &session["asset"]["format"]), (&json!("capture"), &json!("ltgs")));
    let training = &session["training"];
    assert_eq!([&training["step"], &training["steps"]], [30, 30]);
    assert_eq!((&training["state"], &training["curveOf"]), (&json!("finished"), &json!("psnr")));
    assert_eq!(training["curve"].as_array().unwrap().len(), 3);
    assert!(training["etaSecs"].is_null());
    // The scene is what export writes.
    let exported = at("exported.ltgs");
    good(&["export", &run, "-o", &exported, "--quality", "lossless", "--no-verify", "-q"]);
    let expected = litetex_exporters::read_asset(Path::new(&exported), &ReadLimits::default()).unwrap().asset;
    let shown = served(&page);
    assert_eq!(shown.hash(), expected.hash());
    // Photos are those of the cameras, as PNG of the stated size.
    let photos = session["photos"].as_array().unwrap();
    assert_eq!(photos.len(), 9);
    for photo in photos {
        assert!(shown.cameras.iter().any(|camera| photo["view"] == camera.name.as_str()), "{photo}");
    }
    let answer = page.request("GET", photos[4]["url"].as_str().unwrap(), "");
    assert_eq!((answer.status, answer.header("content-type")), (200, Some("image/png")));
    let file = folder.path().join("photo.png");
    std::fs::write(&file, &answer.body).unwrap();
    let (width_px, height_px, rgb) = litetex_gs::capture::read_image(&file).unwrap();
    assert_eq!([&photos[4]["widthPx"], &photos[4]["heightPx"]], [width_px, height_px]);
    let original = Path::new(&capture).join("images").join(photos[4]["view"].as_str().unwrap());
    assert_eq!(litetex_gs::capture::read_image(&original).unwrap().2, rgb);
    let other = page.request("GET", photos[5]["url"].as_str().unwrap(), "");
    assert!(other.body != answer.body, "negative control");
    assert_eq!(page.data("photo/9").status, 404);
    // A later checkpoint takes its place.
    good(&["train", "--resume", &run, "--device", "cpu", "-q", "--steps", "40"]);
    page.wait_for("a later scene", |session| {
        let is_later = session["asset"]["revision"].as_u64() > Some(1);
        is_later && session["training"]["step"] == 40 && session["training"]["state"] == "finished"
    });
    assert_ne!(served(&page).hash(), expected.hash());
    drop(page);
    // An asset has the photos of the capture that is named.
    let page = Page::start(&["view", &exported, "--capture", &capture, "--no-open"]);
    assert_eq!(page.session()["photos"].as_array().unwrap().len(), 9);
    drop(page);
    // Without its capture, a run has none, and says so.
    std::fs::rename(&capture, at("elsewhere")).unwrap();
    let page = view(Path::new(&run));
    assert!(page.session()["photos"].is_null());
    #[cfg(unix)]
    {
        page.signal("INT");
        let (code, message) = page.end();
        assert_eq!(code, Some(130), "{message}");
        assert!(
            message.contains("photos are not shown: ") && message.contains("closing the viewer"),
            "{message}"
        );
    }
    let checkpoint = Path::new(&run).join("checkpoints/step-000040.safetensors");
    let page = view(&checkpoint);
    assert!(page.session()["photos"].is_null() && page.session()["training"].is_null());
    drop(page);
    let (code, message) = bad(&["view", &run, "--capture", &capture, "--no-open"]);
    assert!(code == 3 && message.contains("capture: no such file"), "{code} {message}");
    #[cfg(unix)]
    check_a_run_from_elsewhere(folder.path(), Path::new(&run));
}

#[test]
fn what_cannot_be_shown_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    std::fs::write(at("foreign.html"), "<!doctype html><title>Mine</title>").unwrap();
    std::fs::write(at("broken.ltgs"), "LTGS").unwrap();
    std::fs::write(at("photo.jpg"), "x").unwrap();
    std::fs::create_dir(at("empty")).unwrap();
    for (name, code, what) in [
        ("nowhere.glb", 3, "no such file"),
        ("foreign.html", 3, "not an exported scene"),
        ("broken.ltgs", 3, "broken.ltgs: "),
        ("photo.jpg", 4, "photo.jpg: a \".jpg\" file cannot be used here; expected an asset (.glb, "),
        ("empty", 3, "a folder without checkpoints"),
    ] {
        let (found, message) = bad(&["view", &at(name), "--no-open"]);
        assert!(found == code && message.contains(what), "{name}: {found} {message}");
    }
    let page = Page::start(&["view", "--no-open"]);
    let port = page.address.rsplit(':').next().unwrap();
    let (code, message) = bad(&["view", "--no-open", "--port", port]);
    assert!(code == 2 && message.contains("choose another port"), "{code} {message}");
    let (code, message) = bad(&["view", "--capture", &at("empty"), "--no-open"]);
    assert!(code == 2 && message.contains("FILE|RUN"), "{code} {message}");
}
