//! Incomplete files, misnamed ones, and files that are not assets.

use super::*;
use crate::asset::tests::fixture;
use std::path::PathBuf;

fn written(path: &Path, mesh: bool) -> Vec<PathBuf> {
    let options = WriteOptions { quality: Quality::Balanced, mesh, ..WriteOptions::default() };
    write_asset(path, &fixture(20, 1), &options).unwrap().files
}

fn errors(path: &Path) -> Vec<Issue> {
    let mut issues = validate_file(path).unwrap();
    issues.retain(|i| i.severity == Severity::Error);
    issues
}

#[test]
fn missing_or_damaged_sidecar_files_are_issues() {
    for (name, codes) in
        [("y.gltf", ["LT1024", "LT1018"].as_slice()), ("y.usda", &["LT2012"]), ("y.usdc", &["LT2012"])]
    {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let files = written(&path, name != "y.gltf");
        assert!(files.len() > 2, "{files:?}");
        assert_eq!(errors(&path), [], "negative control");
        for side in &files[1..] {
            let valid = std::fs::read(side).unwrap();
            let file_name = side.file_name().unwrap().to_str().unwrap();
            let told = |what: &str| {
                let issues = errors(&path);
                // The layer, too: lists of issues do not name their file.
                let names = |i: &Issue| codes.contains(&i.code) && i.message.contains(file_name);
                assert!(issues.iter().any(|i| names(i) && i.message.contains(name)), "{what}: {issues:?}");
            };
            std::fs::remove_file(side).unwrap();
            told("missing");
            std::fs::create_dir(side).unwrap();
            told("a folder");
            std::fs::remove_dir(side).unwrap();
            #[cfg(unix)]
            {
                std::os::unix::fs::symlink("/dev/zero", side).unwrap();
                assert!(!errors(&path).is_empty(), "a device elsewhere");
                std::fs::remove_file(side).unwrap();
            }
            std::fs::write(side, &valid[..valid.len() / 2]).unwrap();
            let issues = errors(&path);
            assert!(issues.iter().any(|i| i.message.contains(file_name)), "{file_name} cut: {issues:?}");
            std::fs::write(side, valid).unwrap();
            assert_eq!(errors(&path), [], "negative control");
        }
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(validate_file(&path), Err(Error::Io { .. })), "the file itself");
        std::fs::create_dir(&path).unwrap();
        assert!(matches!(validate_file(&path), Err(Error::Io { .. })), "a folder");
    }
}

#[test]
fn a_quad_mesh_is_not_read_as_an_asset() {
    let folder = tempfile::tempdir().unwrap();
    let files = written(&folder.path().join("y.gltf"), true);
    let mesh = files.iter().find(|f| f.ends_with("y.mesh.glb")).unwrap();
    let error = read_asset(mesh, &ReadLimits::default()).unwrap_err();
    let expected = |text: &str| text.contains("mesh of quads made by litetex");
    assert!(matches!(&error, Error::Unsupported { what, .. } if expected(what)), "{error}");
    let issues = validate_file(mesh).unwrap();
    assert!(issues.len() == 1 && issues[0].severity == Severity::Info && expected(&issues[0].message));
    // The rest of it is plain glTF, which has a validator of its own.
    let bytes = std::fs::read(mesh).unwrap();
    let replaced = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut changed = bytes.clone();
        changed[at..at + to.len()].copy_from_slice(to.as_bytes());
        std::fs::write(mesh, changed).unwrap();
        errors(mesh)
    };
    assert_eq!(replaced("\"indices\":2", "\"indices\":7"), []);
    // Negative control: without its sign it is a file that is not ours.
    let found = replaced("\"kind\":\"quads\"", "\"kind\":\"Quads\"");
    assert!(found.iter().any(|i| i.code == "LT1004"), "{found:?}");
}

#[test]
fn files_beyond_the_limits_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let path = folder.path().join(format!("y.{}", format.extension()));
        written(&path, false);
        let bytes = path.metadata().unwrap().len();
        let limits = |decoded_bytes| ReadLimits { decoded_bytes, layers: None };
        let error = read_asset(&path, &limits(bytes - 1)).unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }), "{error}");
        // 20 GB, sparse, behind a valid beginning.
        std::fs::File::options().write(true).open(&path).unwrap().set_len(20_000_000_000).unwrap();
        let error = read_asset(&path, &ReadLimits::default()).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, Error::TooLarge { .. }), "{message}");
        assert!(
            message.contains("20000000000 bytes") && message.contains("at most 4294967296 are read"),
            "{message}"
        );
        let told = match validate_file(&path) {
            Ok(issues) => {
                issues.iter().any(|i| i.severity == Severity::Error && i.message.contains("20000000000"))
            }
            Err(error) => matches!(error, Error::TooLarge { .. }),
        };
        assert!(told, "{format:?}");
        #[cfg(unix)]
        {
            std::fs::remove_file(&path).unwrap();
            std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
            assert!(matches!(read_asset(&path, &ReadLimits::default()), Err(Error::Io { .. })));
            assert!(matches!(validate_file(&path), Err(Error::Io { .. })));
        }
    }
}
