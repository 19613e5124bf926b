//! Checks the names of assets to be written before any work is done.

use super::asset_args::AssetArgs;
use litetex_exporters::Format;
use litetex_gs::{Error, Result, atomic_file, usage};
use std::path::{Path, PathBuf};

/// Refuses assets that cannot be written. `source` is what they are made from, if that is a file.
///
/// # Errors
/// [`Error::Unsupported`] for unknown extensions and qualities; [`Error::Usage`] for files that exist, files that two
/// outputs or the source share, and options without effect; [`Error::Io`] for folders that cannot be written to.
pub fn check(source: Option<&Path>, outputs: &[PathBuf], args: &AssetArgs) -> Result<()> {
    let mut taken: Vec<(PathBuf, &Path)> = source.map(|s| (normal(s), s)).into_iter().collect();
    for path in outputs {
        let format = Format::of(path)?;
        format.check_quality(args.quality(), path)?;
        format.check_name(path)?;
        let refuse = |what: &str| Err(usage!("{}: {what}", path.display()));
        if path.is_dir() || path.to_string_lossy().ends_with(std::path::is_separator) {
            return refuse("is a folder, expected the name of a file");
        }
        for file in std::iter::once(path.clone()).chain(format.sidecar_files(path, args.mesh)) {
            let name = normal(&file);
            if let Some((_, other)) = taken.iter().find(|(n, _)| *n == name) {
                let what =
                    format!("{} belongs to {} as well; choose another name", file.display(), other.display());
                return refuse(&what);
            }
            // Some sidecars are folders.
            if !file.is_dir() {
                atomic_file::check_place(&file)?;
            }
            if file.exists() && !args.force {
                return Err(usage!("{}: exists; --force replaces it", file.display()));
            }
            taken.push((name, path));
        }
        check_folder(path)?;
    }
    let any = |is: fn(Format) -> bool| outputs.iter().filter_map(|p| Format::from_path(p)).any(is);
    if args.rate_goal().own_limits().is_some() && !any(|f| f == Format::Ltgs) {
        return Err(usage!("--max-size and --max-loss apply only to .ltgs files, and no output is one"));
    }
    if args.quality.is_some() && !any(|f| f != Format::Ply) {
        return Err(Error::Usage(
            "--quality does not apply to PLY files, which have a single quality, and no output is another"
                .into(),
        ));
    }
    if args.spz_version == 4 && !any(|f| f == Format::Spz) {
        return Err(usage!("--spz-version applies only to .spz files, and no output is one"));
    }
    if args.up.is_some_and(|up| up.in_capture.is_none()) && !any(|f| f == Format::Ply) {
        let what = "--up with a program's name applies only to .ply files, and no output is one; other formats say what is up";
        return Err(Error::Usage(what.into()));
    }
    if args.cameras.is_some() && !any(|f| !matches!(f, Format::Ltgs | Format::Html | Format::Ply)) {
        return Err(usage!("--cameras applies only to glTF, USD and .spz files, and no output is one"));
    }
    if args.mesh && !any(|f| f.keeps_textures() && !matches!(f, Format::Ltgs | Format::Html)) {
        return Err(usage!("--mesh applies only to glTF and USD files, and no output is one"));
    }
    Ok(())
}

/// One spelling for each file whose folder exists.
fn normal(path: &Path) -> PathBuf {
    let folder = folder_of(path);
    let folder =
        folder.canonicalize().or_else(|_| std::path::absolute(folder)).unwrap_or_else(|_| folder.to_owned());
    folder.join(path.file_name().unwrap_or_default())
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Checks that files can be created in the folder of a file or, if it does not exist yet, where it will be made.
fn check_folder(path: &Path) -> Result<()> {
    let folder = folder_of(path);
    let there = folder.ancestors().find(|f| f.exists()).unwrap_or(Path::new("."));
    let there = if there.as_os_str().is_empty() { Path::new(".") } else { there };
    if !there.is_dir() {
        return Err(usage!("{}: {} is a file, expected a folder", path.display(), there.display()));
    }
    let probe = there.join(format!(".litetex.{}.probe", std::process::id()));
    let made = std::fs::OpenOptions::new().write(true).create_new(true).open(&probe);
    made.map_err(|e| Error::io(there, e))?;
    std::fs::remove_file(&probe).map_err(|e| Error::io(probe, e))
}

#[cfg(test)]
mod tests {
    use super::super::asset_args::CamerasName;
    use super::*;

    #[test]
    fn files_that_share_names_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let fails = |source: Option<&str>, outputs: &[&str], args: &AssetArgs| {
            let outputs: Vec<PathBuf> = outputs.iter().map(|n| at(n)).collect();
            check(source.map(at).as_deref(), &outputs, args).map_err(|e| e.to_string()).err()
        };
        let plain = AssetArgs::default();
        let mesh = AssetArgs { mesh: true, force: true, ..AssetArgs::default() };
        assert_eq!(fails(Some("in.glb"), &["a.glb", "a.ltgs", "b/c.usda", "b/c.usdc"], &plain), None);
        for (source, outputs) in [
            (None, vec!["a.glb", "./a.glb"]),
            (None, vec!["a.mesh.glb", "a.glb"]),
            (Some("q.mesh.glb"), vec!["q.glb"]),
            (Some("q.glb"), vec!["q.glb"]),
        ] {
            let error = fails(source, &outputs, &mesh).unwrap();
            assert!(error.contains("as well"), "{outputs:?}: {error}");
        }
        // Sidecar files count, not only the named ones.
        std::fs::write(at("y.bin"), "mine").unwrap();
        std::fs::create_dir(at("y_usda_textures")).unwrap();
        for name in ["y.gltf", "y.usda"] {
            assert!(fails(None, &[name], &plain).unwrap().contains("--force"), "{name}");
            assert_eq!(fails(None, &[name], &AssetArgs { force: true, ..AssetArgs::default() }), None);
        }
        assert!(fails(None, &["y.bin/z.glb"], &plain).unwrap().contains("expected a folder"));
        assert!(fails(None, &["a@b.usda"], &plain).unwrap().contains("must be UTF-8 without"));
        assert!(fails(None, &["z.glb/"], &plain).unwrap().contains("is a folder"));
        assert!(fails(None, &["z.ltgs"], &mesh).unwrap().contains("--mesh"));
        let cameras = AssetArgs { cameras: Some(CamerasName::All), ..AssetArgs::default() };
        assert!(fails(None, &["z.ltgs"], &cameras).unwrap().contains("--cameras"));
        assert_eq!(fails(None, &["z.ltgs", "z.usda"], &cameras), None);
        let version = AssetArgs { spz_version: 4, ..AssetArgs::default() };
        assert!(fails(None, &["z.glb"], &version).unwrap().contains("--spz-version"));
        assert_eq!(fails(None, &["z.glb", "z.spz"], &version), None);
        let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(left.len(), 2, "no probe stays: {left:?}");
    }
}
