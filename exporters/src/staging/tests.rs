//! Nothing is replaced without permission or lost to failures and kills, and staged files are readable.

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
    asset.texels.iter_mut().for_each(|t| *t *= 1.0 / title.len() as f32);
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
    assert!(snapshot(folder.path()).keys().all(|p| p.extension().is_none_or(|e| e != "tmp")));
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
fn a_failing_overwrite_keeps_the_old_asset() {
    for name in ["y.gltf", "y.glb", "y.usda", "y.usdc", "y.usdz", "y.ltgs"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        // First without an older one: nothing stays, not even the folder of images.
        for old in [None, Some(with_title("old"))] {
            if let Some(old) = &old {
                write_asset(&path, old, &options(true)).unwrap();
            }
            let before = snapshot(folder.path());
            let num_files = stage_asset(&path, &with_title("new"), &options(true)).unwrap().names.len();
            for missing in 0..num_files {
                let staged = stage_asset(&path, &with_title("new"), &options(true)).unwrap();
                // Renaming this one will fail, after those before it have been renamed.
                std::fs::remove_file(staged.new_file(&staged.names[missing])).unwrap();
                assert!(matches!(staged.publish(true), Err(Error::Io { .. })));
                assert_eq!(snapshot(folder.path()), before, "{name}: file {missing} of {num_files}");
            }
            if old.is_some() {
                assert_eq!(title(&path), "old");
            }
        }
        // Negative control.
        write_asset(&path, &with_title("new"), &options(true)).unwrap();
        assert_eq!(title(&path), "new");
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

/// Starts to replace the asset at `path` and is killed after some steps of the move. Returns whether all was done before.
fn killed_after(steps: usize, path: &Path, asset: &SplatAsset) -> bool {
    let staged = stage_asset(path, asset, &options(true)).unwrap();
    staged.steps.left.set(Some(steps));
    staged.publish(true).is_ok()
}

#[test]
fn an_interrupted_move_is_finished_by_the_next_command() {
    for name in ["y.gltf", "y.glb", "y.usda", "y.usdc"] {
        for old in [None, Some(with_title("old"))] {
            let mut mixed = 0;
            for steps in 0.. {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join(name);
                if let Some(old) = &old {
                    write_asset(&path, old, &options(true)).unwrap();
                }
                let before = snapshot(folder.path());
                if killed_after(steps, &path, &with_title("new")) {
                    assert!(steps > 3, "{name}: {steps}");
                    break;
                }
                let left = snapshot(folder.path());
                let has_journal = left.keys().any(|p| p.ends_with("swap.json"));
                let at_place = |all: &BTreeMap<PathBuf, _>| {
                    let is_staged = |p: &&PathBuf| p.to_string_lossy().contains("/.y.");
                    all.keys().filter(|p| !is_staged(p)).cloned().collect::<Vec<_>>()
                };
                mixed += usize::from(has_journal && at_place(&left) != at_place(&before));
                // Reading finishes what was begun, and leaves alone what was not.
                let found = read_asset(&path, &ReadLimits::default());
                let expected = if has_journal { Some("new") } else { old.as_ref().map(|_| "old") };
                let found = found.ok().map(|c| {
                    assert_eq!(c.hash, Some(c.asset.hash()), "{name} after {steps}: mixed");
                    c.asset.provenance.title
                });
                assert_eq!(found.as_deref(), expected, "{name} after {steps}");
                // The next export tidies up, and is whole.
                write_asset(&path, &with_title("third"), &options(true)).unwrap();
                assert_eq!(title(&path), "third");
                assert!(snapshot(folder.path()).keys().all(|p| p.extension().is_none_or(|e| e != "tmp")));
            }
            assert!(mixed > 1 || old.is_some(), "negative control: {name} was killed between files");
        }
    }
}

#[test]
fn a_move_that_cannot_be_finished_is_undone() {
    let mut undone = 0;
    for steps in 0.. {
        let folder = tempfile::tempdir().unwrap();
        let (path, aside) = (folder.path().join("y.usda"), folder.path().join("aside"));
        write_asset(&path, &with_title("old"), &options(true)).unwrap();
        let before = snapshot(folder.path());
        if killed_after(steps, &path, &with_title("new")) {
            break;
        }
        let is_moved = std::fs::read(&path).unwrap() != *before[&path].as_ref().unwrap();
        let has_journal = snapshot(folder.path()).keys().any(|p| p.ends_with("swap.json"));
        if is_moved || !has_journal {
            continue;
        }
        // A folder in the place of the last file.
        std::fs::rename(&path, &aside).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert!(read_asset(&path, &ReadLimits::default()).is_err());
        std::fs::remove_dir(&path).unwrap();
        std::fs::rename(&aside, &path).unwrap();
        assert_eq!(snapshot(folder.path()), before, "after {steps}");
        undone += 1;
    }
    assert!(undone > 3, "{undone}");
}

#[test]
fn only_leftovers_of_dead_processes_are_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("y.glb");
    let make = |name: &str, entries: &[&str]| {
        let made = folder.path().join(name);
        entries.iter().for_each(|e| std::fs::create_dir_all(made.join(e).parent().unwrap()).unwrap());
        entries.iter().for_each(|e| std::fs::write(made.join(e), "x").unwrap());
        made
    };
    let dead = make(".y.glb.4194000-0.tmp", &["lock", "new/y.glb"]);
    let other = make(".other.usda.4194000-3.tmp", &["lock", "new/a/b.png", "old/c"]);
    let kept = [
        make(".y.glb.4194001-0.tmp", &["no_lock"]),
        make("y.glb.4194000-0.tmp", &["lock"]),
        make(".y.glb.x-0.tmp", &["lock"]),
        make(".y.glb", &["lock"]),
    ];
    let living = stage_asset(&path, &with_title("living"), &options(false)).unwrap();
    assert!(!dead.exists() && !other.exists());
    write_asset(&path, &with_title("new"), &options(false)).unwrap();
    assert!(kept.iter().all(|k| k.is_dir()));
    // A living process goes on undisturbed.
    assert!(living.path().is_file());
    living.publish(true).unwrap();
    assert_eq!(title(&path), "living");
}

#[test]
fn a_foreign_journal_moves_nothing() {
    for names in
        [["../y.bin", "y.gltf"], ["/tmp/y.bin", "y.gltf"], ["notes.txt", "y.gltf"], ["y.bin", "x.gltf"]]
    {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("y.gltf");
        write_asset(&path, &with_title("old"), &options(false)).unwrap();
        std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
        let staging = folder.path().join(".y.gltf.4194000-0.tmp");
        std::fs::create_dir_all(staging.join("new")).unwrap();
        for name in ["notes.txt", "y.bin", "y.gltf", "x.gltf", "lock"] {
            std::fs::write(staging.join("new").join(name), "not yours").unwrap();
        }
        std::fs::write(staging.join("lock"), "").unwrap();
        let files = names.map(|name| serde_json::json!({"name": name, "replaces": true}));
        let journal = serde_json::json!({"files": files, "folders": []});
        std::fs::write(staging.join("swap.json"), journal.to_string()).unwrap();
        assert_eq!(title(&path), "old", "{names:?}");
        assert_eq!(std::fs::read(folder.path().join("notes.txt")).unwrap(), b"mine");
    }
}
