//! Pages: what they hold, what they may do, and what stays outside.

use super::tags::tags;
use super::*;
use crate::asset::tests::fixture;
use crate::ltgs::{self, LtgsOptions};
use crate::{AssetCamera, Error, Provenance, Quality, ReadLimits};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use sha2::{Digest as _, Sha256};
use std::path::Path;

/// Bytes that a page may add to its scene in base64.
const PAGE_BYTES_MAX: usize = 250_000;

/// Texts that break out of elements and attributes where they are not escaped.
const HOSTILE: [&str; 7] = [
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "</title><img src=x onerror=alert(1)>",
    "\"><meta http-equiv=refresh content=\"0;url=//x\">",
    "' onload='x",
    "]]>&lt;\u{2028}\u{0}\n",
    "-->",
];

fn text(html: &[u8]) -> &str {
    std::str::from_utf8(html).unwrap()
}

fn shape(html: &[u8]) -> Vec<String> {
    tags(html).map(|tag| String::from_utf8_lossy(tag.name).to_ascii_lowercase()).collect()
}

#[test]
fn a_page_keeps_its_scene_within_its_size() {
    let folder = tempfile::tempdir().unwrap();
    for quality in [Quality::Lossless, Quality::Balanced, Quality::Tiny] {
        let (asset, options) = (fixture(50, 2), LtgsOptions { quality, ..LtgsOptions::default() });
        let ltgs = ltgs::encode(&asset, &options).unwrap();
        let html = encode_html(&asset, &options).unwrap();
        assert_eq!(embedded(&html, Path::new("a.html")).unwrap(), ltgs, "byte for byte");
        assert!(html.len() <= ltgs.len().div_ceil(3) * 4 + PAGE_BYTES_MAX, "{} bytes", html.len());
        let path = folder.path().join("a.html");
        std::fs::write(&path, &html).unwrap();
        let read = read_html(&path, &ReadLimits::default()).unwrap();
        let expected = ltgs::decode(&ltgs, &path, &ReadLimits::default()).unwrap();
        assert_eq!((&read.asset, read.quality, read.hash), (&expected.asset, Some(quality), expected.hash));
        assert_eq!(read.sections.iter().map(|s| s.bytes).sum::<u64>(), html.len() as u64);
        assert!(read.format.starts_with("HTML with "), "{}", read.format);
        assert!(validate(&html, &path).is_empty());
    }
}

#[test]
fn titles_and_names_stay_text() {
    let plain = encode_html(&fixture(5, 0), &LtgsOptions::default()).unwrap();
    for hostile in HOSTILE {
        let mut asset = fixture(5, 0);
        let all = hostile.to_owned();
        asset.provenance = Provenance {
            title: all.clone(),
            author: all.clone(),
            licence: all.clone(),
            source: all.clone(),
            ..Provenance::default()
        };
        asset.cameras = vec![AssetCamera { name: all, ..AssetCamera::default() }];
        let ltgs = ltgs::encode(&asset, &LtgsOptions::default()).unwrap();
        let html = wrapped(&Page::embedded(), &ltgs, &asset.provenance).unwrap();
        // As many elements as before, and the three of author, licence and source.
        let (mut expected, found) = (shape(&plain), shape(&html));
        expected.extend(["meta"; 3].map(str::to_owned));
        expected.sort();
        let sorted = |mut names: Vec<String>| {
            names.sort();
            names
        };
        assert_eq!(sorted(found), expected, "{hostile:?}");
        let session = tags(&html).find(|tag| tag.attribute("id") == Some(SESSION_ID.as_bytes())).unwrap();
        let session: Session = serde_json::from_slice(&html[session.content.unwrap()]).unwrap();
        assert_eq!(session.title, hostile);
        assert_eq!(embedded(&html, Path::new("a.html")).unwrap(), ltgs);
    }
    // Negative control: unescaped, such a title adds elements.
    let at = text(&plain).find("<title>").unwrap() + 7;
    let broken = [&plain[..at], HOSTILE[2].as_bytes(), &plain[at..]].concat();
    assert!(shape(&broken).len() > shape(&plain).len());
}

#[test]
fn the_policy_allows_the_pages_own_scripts_and_nothing_else() {
    let page = Page::embedded();
    let html = encode_html(&fixture(5, 0), &LtgsOptions::default()).unwrap();
    let policy = tags(&html).find(|tag| tag.attribute("http-equiv").is_some()).unwrap();
    let policy = text(policy.attribute("content").unwrap()).to_owned();
    assert_eq!(policy, page.policy(Place::File), "escaping changes nothing in it");
    let mut hashed = 0;
    for tag in tags(&html).filter(|tag| tag.is("script") || tag.is("style")) {
        assert_eq!(tag.attribute("src"), None);
        let hash = BASE64_STANDARD.encode(Sha256::digest(&html[tag.content.clone().unwrap()]));
        let is_data = tag.attribute("type").is_some_and(|of| of.starts_with(b"application/"));
        assert_eq!(policy.contains(&hash), !is_data, "{}", text(tag.name));
        hashed += usize::from(!is_data);
    }
    assert!(hashed >= 2);
    for part in ["default-src 'none'", "base-uri 'none'", "form-action 'none'"] {
        assert!(policy.contains(part), "{policy}");
    }
    assert!(
        !policy.contains("connect-src") && !policy.contains("unsafe") && !policy.contains("http"),
        "{policy}"
    );
    let served = page.policy(Place::Server);
    assert!(served.contains("connect-src 'self'") && served.contains("frame-ancestors 'none'"), "{served}");
    // Negative control: another script has another hash.
    let other = page.html().replace("</script>", " </script>");
    assert_ne!(Page::new(&other).policy(Place::File), policy);
}

#[test]
fn the_page_loads_nothing() {
    let external = |html: &str| {
        let of_tag = |tag: tags::Tag<'_>| {
            ["src", "href", "data", "action", "poster", "srcset"].iter().any(|name| {
                let value = tag.attribute(name).unwrap_or_default();
                !value.is_empty() && !value.starts_with(b"data:") && !value.starts_with(b"#")
            })
        };
        let styles = tags(html.as_bytes()).filter(|tag| tag.is("style")).filter_map(|tag| tag.content);
        let of_style =
            |style: &str| style.contains("@import") || style.contains("url(http") || style.contains("url(//");
        tags(html.as_bytes()).any(of_tag) || styles.map(|content| &html[content]).any(of_style)
    };
    assert!(!external(Page::embedded().html()));
    for added in
        ["<img src=//x/y.png>", "<link rel=stylesheet href='https://x/y.css'>", "<style>@import 'x';</style>"]
    {
        assert!(external(&format!("{}{added}", Page::embedded().html())), "negative control: {added}");
    }
    // A comment in a script could change where it ends.
    let page = Page::embedded().html();
    for tag in tags(page.as_bytes()).filter(|tag| tag.is("script")) {
        assert!(!page[tag.content.unwrap()].contains("<!--"));
    }
}

#[test]
fn foreign_and_damaged_pages_are_told_apart() {
    let path = Path::new("a.html");
    let html = encode_html(&fixture(5, 0), &LtgsOptions::default()).unwrap();
    let told = |html: &[u8], what: &str| {
        let error = embedded(html, path).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }) && error.to_string().contains(what), "{error}");
        assert_eq!(validate(html, path)[0].code, "LT5001");
    };
    told(b"<!doctype html><title>Mine</title>", "not an exported scene");
    told(text(&html).replace(ASSET_TYPE, "text/plain").as_bytes(), "expected a script of the type");
    told(text(&html).replace("TFRHU", "TFRH!").as_bytes(), "not base64");
    let start = text(&html).find(ASSET_TYPE).unwrap();
    told(&html[..start + 200], "truncated");
    let element = &text(&html)[start - 14..];
    let element = &element[..element.find("</script>").unwrap() + 9];
    told([&html, element.as_bytes()].concat().as_slice(), "there are two");
    // Negative control: a copy in a comment is none.
    assert!(embedded(format!("{}<!--{element}-->", text(&html)).as_bytes(), path).is_ok());
}

#[test]
fn a_page_without_a_charset_or_title_cannot_hold_a_scene() {
    let charset = "<meta charset=utf-8>";
    for html in [
        "<title></title><body>".to_owned(),
        format!("{charset}<body>"),
        format!("{charset}<title></title>"),
        format!("{charset}<title><body>"),
        format!("<title></title>{charset}<body>"),
        format!("{charset}<body><title></title>"),
        "<meta name=x><title></title><body>".to_owned(),
    ] {
        assert!(wrapped(&Page::new(&html), b"", &Provenance::default()).is_err(), "{html}");
    }
    let html = format!("{charset}<title></title><body>");
    assert!(wrapped(&Page::new(&html), b"", &Provenance::default()).is_ok());
}
