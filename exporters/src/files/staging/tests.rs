//! Nothing is replaced without permission, staged files are readable, and what a killed export leaves is whole or refused.

use super::*;
use crate::asset::tests::fixture;
use crate::{Format, Quality, ReadLimits, SplatAsset, WriteOptions, read_asset, stage_asset, write_asset};
use std::collections::BTreeMap;

fn options(mesh: bool) -> WriteOptions<'static> {
    WriteOptions { quality: Quality::Balanced, mesh, ..WriteOptions::default() }
}

fn with_title(title: &str) -> SplatAsset {
    let mut asset = fixture(20, 1);
    asset.provenance.title = title.to_owned();
    // Other texels make other images.
    asset.texels.iter_mut().step_by(3).for_each(|t| *t *= 1.0 / title.len() as f32);
    asset
}

/// Every file below a folder with its bytes; links as `None`.
fn snapshot(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap()) {
        let path = entry.path();
        match entry.file_type().unwrap() {
            kind if kind.is_dir() => {
                found.extend(snapshot(&path));
                found.insert(path, None);
            }
            kind if kind.is_symlink() => drop(found.insert(path, None)),
            _ => drop(found.insert(path.clone(), Some(std::fs::read(path).unwrap()))),
        }
    }
    found
}

fn title(path: &Path) -> String {
    let contents = read_asset(path, &ReadLimits::default()).unwrap();
    assert_eq!(contents.hash, Some(contents.asset.hash()), "{}", path.display());
    contents.asset.provenance.title
}

fn kind(error: &Error) -> Option<ErrorKind> {
    match error {
        Error::Io { source, .. } => Some(source.kind()),
        _ => None,
    }
}

#[test]
fn staged_files_are_readable_and_published_in_place() {
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let stem = format!("{format:?}");
        let path = folder.path().join(format!("{stem}.{}", format.extension()));
        let staged = stage_asset(&path, &with_title("a"), &options(true)).unwrap();
        assert!(!path.exists());
        let before = read_asset(&staged.path(), &ReadLimits::default()).unwrap();
        let (files, expected) = (staged.files().to_vec(), staged.written().clone());
        let written = staged.publish(false).unwrap();
        assert_eq!((&written.files, &written), (&files, &expected));
        assert_eq!(written.files[0], path);
        let sizes: Vec<u64> = written.files.iter().map(|f| f.metadata().unwrap().len()).collect();
        assert_eq!(sizes, written.sizes, "{format:?}");
        assert_eq!(read_asset(&path, &ReadLimits::default()).unwrap(), before, "{format:?}");
        // Sidecar files are those announced.
        let said = format.sidecar_files(&path, true);
        for file in &written.files[1..] {
            assert!(said.iter().any(|s| file.starts_with(s)), "{}: {said:?}", file.display());
        }
        assert!(said.iter().all(|s| s.exists() || s.extension().is_some_and(|e| e == "exr")), "{said:?}");
        let mesh = said.iter().any(|f| f.ends_with(format!("{stem}.mesh.glb")));
        assert_eq!(mesh, matches!(format, Format::Glb | Format::Gltf));
        assert_eq!(format.sidecar_files(&path, false).len(), said.len() - usize::from(mesh));
    }
    assert!(snapshot(folder.path()).keys().all(|p| p.extension().is_none_or(|e| e != "part")));
    // Formats under one stem share only the mesh.
    for format in Format::ALL.into_iter().filter(|f| f.keeps_textures()) {
        let path = folder.path().join(format!("scene.{}", format.extension()));
        write_asset(&path, &with_title(format.extension()), &options(true)).unwrap();
    }
    for format in Format::ALL.into_iter().filter(|f| f.keeps_textures()) {
        assert_eq!(title(&folder.path().join(format!("scene.{}", format.extension()))), format.extension());
    }
}

#[test]
fn unpublished_files_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    write_asset(&path, &with_title("old"), &options(true)).unwrap();
    let before = snapshot(folder.path());
    let staged = [(); 2].map(|()| stage_asset(&path, &with_title("new"), &options(true)).unwrap());
    assert_ne!(staged[0].path(), staged[1].path(), "two at once do not meet");
    assert!(snapshot(folder.path()).len() > before.len(), "negative control");
    drop(staged);
    assert_eq!(snapshot(folder.path()), before);
}

#[test]
fn sidecar_files_are_not_replaced_without_permission() {
    for (name, sides) in [
        ("y.gltf", ["y.bin", "y.mesh.glb", "y_atlas_0.png"].as_slice()),
        ("y.glb", &["y.mesh.glb"]),
        ("y.usda", &["y_usda_textures/page0.png", "y_usda_textures/quads0.png"]),
        ("y.usdc", &["y_usdc_textures/page0.png"]),
        ("y.ltgs", &["y.ltgs"]),
    ] {
        for side in sides {
            let folder = tempfile::tempdir().unwrap();
            let (path, side) = (folder.path().join(name), folder.path().join(side));
            std::fs::create_dir_all(side.parent().unwrap()).unwrap();
            std::fs::write(&side, "mine").unwrap();
            let before = snapshot(folder.path());
            let staged = stage_asset(&path, &with_title("new"), &options(true)).unwrap();
            let error = staged.publish(false).unwrap_err();
            assert_eq!(kind(&error), Some(ErrorKind::AlreadyExists), "{error}");
            let message = error.to_string();
            assert!(message.contains(&side.display().to_string()) && message.contains(name), "{message}");
            assert_eq!(snapshot(folder.path()), before);
            // Negative control: when asked, it is.
            stage_asset(&path, &with_title("new"), &options(true)).unwrap().publish(true).unwrap();
            assert_ne!(std::fs::read(&side).unwrap(), b"mine");
            assert_eq!(title(&path), "new");
        }
    }
}

#[test]
fn conflicting_files_and_folders_are_errors() {
    let asset = with_title("new");
    for (name, obstacle, is_folder, expected) in [
        ("y.gltf", "y.gltf", true, ErrorKind::IsADirectory),
        ("y.gltf", "y.bin", true, ErrorKind::IsADirectory),
        ("y.usda", "y_usda_textures/page0.png", true, ErrorKind::IsADirectory),
        ("y.usda", "y_usda_textures", false, ErrorKind::NotADirectory),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (path, obstacle) = (folder.path().join(name), folder.path().join(obstacle));
        if is_folder {
            std::fs::create_dir_all(obstacle.join("full")).unwrap();
        } else {
            std::fs::write(&obstacle, "mine").unwrap();
        }
        let before = snapshot(folder.path());
        let error = write_asset(&path, &asset, &options(false)).unwrap_err();
        assert_eq!(kind(&error), Some(expected), "{error}");
        assert!(error.to_string().contains(&obstacle.display().to_string()), "{error}");
        assert_eq!(snapshot(folder.path()), before);
    }
    let nowhere = Path::new("no/such/folder/y.glb");
    let error = write_asset(nowhere, &asset, &options(false)).unwrap_err();
    assert_eq!(kind(&error), Some(ErrorKind::NotFound), "{error}");
    assert!(error.to_string().contains("no/such/folder/y.glb"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_link_is_replaced_and_its_target_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (path, real) = (folder.path().join("y.glb"), folder.path().join("real.glb"));
    std::fs::write(&real, "mine").unwrap();
    std::os::unix::fs::symlink(&real, &path).unwrap();
    let staged = stage_asset(&path, &with_title("new"), &options(false)).unwrap();
    assert_eq!(kind(&staged.publish(false).unwrap_err()), Some(ErrorKind::AlreadyExists));
    write_asset(&path, &with_title("new"), &options(false)).unwrap();
    assert_eq!(std::fs::read(&real).unwrap(), b"mine");
    assert!(!path.is_symlink() && title(&path) == "new");
    // A dangling link is in the way, too, but one to a folder of images serves as the folder.
    let path = folder.path().join("z.usda");
    std::os::unix::fs::symlink("nowhere", &path).unwrap();
    let staged = stage_asset(&path, &with_title("new"), &options(false)).unwrap();
    assert_eq!(kind(&staged.publish(false).unwrap_err()), Some(ErrorKind::AlreadyExists));
    let elsewhere = folder.path().join("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, folder.path().join("z_usda_textures")).unwrap();
    write_asset(&path, &with_title("new"), &options(false)).unwrap();
    assert!(elsewhere.join("page0.png").is_file());
    assert_eq!(title(&path), "new");
}

/// Leaves the files as a process does that is killed after some of the moves.
fn killed_after(moves: usize, staged: Staged) {
    staged.names[..moves].iter().for_each(|name| staged.put(name).unwrap());
    std::mem::forget(staged);
}

#[test]
fn a_killed_export_leaves_an_asset_or_files_that_are_refused() {
    for (name, num_refused) in [("y.gltf", 3), ("y.glb", 0), ("y.usda", 2), ("y.usdc", 2)] {
        for old in [None, Some("older")] {
            let mut refused = 0;
            for moves in 0.. {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join(name);
                if let Some(old) = old {
                    write_asset(&path, &with_title(old), &options(true)).unwrap();
                }
                let staged = stage_asset(&path, &with_title("new"), &options(true)).unwrap();
                let num_files = staged.names.len();
                if moves > num_files {
                    break;
                }
                killed_after(moves, staged);
                match read_asset(&path, &ReadLimits::default()) {
                    Ok(contents) => {
                        assert_eq!(contents.hash, Some(contents.asset.hash()), "{name} after {moves}: mixed");
                        let expected = if moves == num_files { Some("new") } else { old };
                        assert_eq!(
                            Some(contents.asset.provenance.title.as_str()),
                            expected,
                            "{name} after {moves}"
                        );
                    }
                    Err(error) if old.is_none() => {
                        assert_eq!(kind(&error), Some(ErrorKind::NotFound), "{error}")
                    }
                    Err(error) => {
                        refused += 1;
                        let says = |word: &str| error.to_string().contains(word);
                        assert!(
                            says(name) && (says(".png\"") || says("y.bin")) && says("export the scene again"),
                            "{error}"
                        );
                        let issues = crate::validate_file(&path).unwrap();
                        assert!(
                            issues.iter().any(|i| i.message.contains("export the scene again")),
                            "{issues:?}"
                        );
                    }
                }
                // The next export is whole.
                write_asset(&path, &with_title("third"), &options(true)).unwrap();
                assert_eq!(title(&path), "third");
            }
            assert_eq!(refused, if old.is_some() { num_refused } else { 0 }, "{name}");
        }
    }
}

#[test]
fn without_hashes_a_mixed_asset_would_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("y.gltf");
    write_asset(&path, &with_title("older"), &options(false)).unwrap();
    killed_after(1, stage_asset(&path, &with_title("new"), &options(false)).unwrap());
    assert!(read_asset(&path, &ReadLimits::default()).is_err());
    let issues = crate::validate_file(&path).unwrap();
    assert_eq!(issues.iter().filter(|i| i.severity == crate::Severity::Error).count(), 1, "{issues:?}");
    let mut json: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let extension = "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting/extensions";
    let extension = &mut json.pointer_mut(extension).unwrap()[crate::gltf::EXTENSION];
    assert!(extension.as_object_mut().unwrap().remove("sidecars").is_some());
    std::fs::write(&path, json.to_string()).unwrap();
    let mixed = read_asset(&path, &ReadLimits::default()).unwrap();
    assert_ne!(mixed.hash, Some(mixed.asset.hash()));
}
