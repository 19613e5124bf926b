//! Poses that are there and cannot be read: COLMAP models that lack a file, tables in another encoding, and the forms of
//! programs that are not read. Whoever has them should not be told to find the poses of bare photos.

use super::colmap::part;
use super::lookup::begins_with_all;
use super::reality_capture;
use crate::Error;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// Levels of folders that are looked into, the named one included.
const DEPTH_MAX: usize = 3;

/// Folders, and files of these extensions, that are looked at.
const FOLDERS_MAX: usize = 200;
const FILES_MAX: usize = 500;

/// A form of poses that is not read, and how to come to one that is.
struct Form {
    extensions: &'static [&'static str],
    /// What the file's beginning contains; nothing if the name tells enough.
    texts: &'static [&'static str],
    /// What the stem ends in.
    stem: &'static str,
    what: &'static str,
    remedy: &'static str,
}

const fn form(
    extensions: &'static [&'static str],
    (texts, stem): (&'static [&'static str], &'static str),
    what: &'static str,
    remedy: &'static str,
) -> Form {
    Form { extensions, texts, stem, what, remedy }
}

const AS_COLMAP: &str = "export a COLMAP model (cameras, images, points3D) instead";

const FORMS: [Form; 12] = [
    form(&["out"], (&["# Bundle file"], ""), "the poses of Bundler", AS_COLMAP),
    form(
        &["npy"],
        (&[], "poses_bounds"),
        "the poses of LLFF",
        "copy the COLMAP model that they were made from here (sparse/0)",
    ),
    form(
        &["json"],
        (&["\"shots\"", "\"cameras\""], ""),
        "the poses of OpenSfM",
        "run \"opensfm export_colmap\"",
    ),
    form(
        &["json"],
        (&["\"sfm_data_version\""], ""),
        "the poses of OpenMVG",
        "run \"openMVG_main_openMVG2Colmap\"",
    ),
    form(
        &["json"],
        (&["\"img_name\"", "\"rotation\"", "\"position\""], ""),
        "the cameras of a trained model of 3D Gaussian splatting",
        "name the capture that it was trained on",
    ),
    form(&["sfm"], (&["\"views\""], ""), "the poses of Meshroom (AliceVision)", AS_COLMAP),
    form(&["nvm"], (&["NVM_V3"], ""), "the poses of VisualSFM", AS_COLMAP),
    form(
        &["psx", "psz"],
        (&[], ""),
        "a project of Metashape",
        "choose \"Export Cameras\" there, and write the XML here",
    ),
    form(
        &["rcproj", "rsproj"],
        (&[], ""),
        "a project of RealityScan or RealityCapture",
        "export \"Internal/External camera parameters\" (.csv) there, and write the file here",
    ),
    form(&["xml"], (&["<BlocksExchange"], ""), "the poses of ContextCapture (BlocksExchange)", AS_COLMAP),
    form(&["txt"], (&[], "calibrated_external_camera_parameters"), "the poses of Pix4D", AS_COLMAP),
    form(&["p4d"], (&[], ""), "a project of Pix4D", AS_COLMAP),
];

/// Extensions of these forms that archives are unpacked for; the others are so anyway.
pub(crate) const EXTENSIONS: [&str; 9] =
    ["out", "npy", "sfm", "nvm", "psx", "psz", "rcproj", "rsproj", "p4d"];

/// What there is about poses in a folder and the folders in it, or in a file, and why they cannot be read; `None` if there
/// are none.
pub(crate) fn problem(path: &Path) -> Option<Error> {
    if path.is_file() {
        return of_file(path);
    }
    let mut num_files = 0;
    let mut queue = VecDeque::from([(path.to_owned(), 1)]);
    for _ in 0..FOLDERS_MAX {
        let (folder, depth) = queue.pop_front()?;
        if let Some(error) = of_model(&folder) {
            return Some(error);
        }
        let (folders, mut files) = entries(&folder);
        files.truncate(FILES_MAX - num_files);
        num_files += files.len();
        if let Some(error) = files.iter().find_map(|file| of_file(file)) {
            return Some(error);
        }
        if depth < DEPTH_MAX {
            queue.extend(folders.into_iter().map(|inner| (inner, depth + 1)));
        }
    }
    None
}

/// The folders in a folder, and its files that may hold poses; sorted. Links are not followed, so that the walk ends.
fn entries(folder: &Path) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let (mut folders, mut files) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => folders.push(entry.path()),
            Ok(kind) if kind.is_file() && may_be_poses(&entry.path()) => files.push(entry.path()),
            _ => {}
        }
    }
    folders.sort();
    files.sort();
    (folders, files)
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

fn may_be_poses(path: &Path) -> bool {
    has_extension(path, &["csv"]) || FORMS.iter().any(|form| has_extension(path, form.extensions))
}

/// A model that has some of its files, not all that it needs.
fn of_model(folder: &Path) -> Option<Error> {
    let [cameras, images, points] = ["cameras", "images", "points3D"].map(|stem| part(folder, stem));
    // One file alone may be of another program.
    let count = [&cameras, &images, &points].into_iter().flatten().count();
    let lost = match (&cameras, &images) {
        (None, None) => "cameras and images",
        (None, Some(_)) => "cameras",
        (Some(_), None) => "images",
        (Some(_), Some(_)) => return None,
    };
    let is_named = folder.file_name().is_some_and(|name| {
        let name = name.to_string_lossy();
        name == "sparse" || (!name.is_empty() && name.bytes().all(|b| b.is_ascii_digit()))
    });
    (count >= 2 || (count == 1 && is_named)).then(|| {
        let files: Vec<String> =
            lost.split(" and ").map(|stem| format!("neither \"{stem}.bin\" nor \"{stem}.txt\"")).collect();
        invalid!(
            folder,
            "this COLMAP model lacks files: {} is here; copy the whole model",
            files.join(", and ")
        )
    })
}

fn of_file(file: &Path) -> Option<Error> {
    if has_extension(file, &["csv"]) {
        let found = reality_capture::unreadable_table(file)?;
        return Some(unsupported!(
            file,
            "the cameras of RealityScan or RealityCapture, {found}; save the table as UTF-8, separated by commas"
        ));
    }
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let form = FORMS.iter().find(|form| {
        has_extension(file, form.extensions)
            && stem.ends_with(form.stem)
            && (form.texts.is_empty() || begins_with_all(file, form.texts))
    })?;
    Some(unsupported!(
        file,
        "{}, which {} not read; {}, or find the poses of the photos again: litetex capture PHOTOS -o CAPTURE",
        form.what,
        if form.what.starts_with("a ") { "is" } else { "are" },
        form.remedy
    ))
}

#[cfg(test)]
mod tests {
    use crate::capture::fixtures::Scene;
    use crate::capture::{Capture, LoadOptions};
    use crate::{Error, Result};
    use std::path::Path;

    fn load(path: &Path) -> Result<Capture> {
        Capture::load(path, &LoadOptions::default())
    }

    /// What loading photos with these files beside them says.
    fn refused(files: &[(&str, &[u8])]) -> Error {
        let folder = tempfile::tempdir().unwrap();
        Scene::ring(3).write_photos(&folder.path().join("images"), (12, 8));
        for (name, bytes) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        load(folder.path()).err().unwrap()
    }

    #[test]
    fn poses_of_other_programs_are_named_with_what_to_export() {
        for (name, bytes, words) in [
            (
                "bundle.out",
                &b"# Bundle file v0.3\n12 0\n"[..],
                "Bundler, which are not read; export a COLMAP model",
            ),
            ("poses_bounds.npy", b"\x93NUMPY", "LLFF, which are not read; copy the COLMAP model"),
            ("sfm/reconstruction.json", b"[{\"cameras\":{},\"shots\":{}}]", "export_colmap"),
            ("sfm_data.json", b"{\"sfm_data_version\":\"0.3\"}", "openMVG2Colmap"),
            ("cameras.json", b"[{\"img_name\":\"a\",\"position\":[],\"rotation\":[]}]", "it was trained on"),
            ("cameras.sfm", b"{\"views\":[],\"poses\":[]}", "Meshroom"),
            ("model.NVM", b"NVM_V3\n", "VisualSFM"),
            (
                "project.psx",
                b"<document/>",
                "a project of Metashape, which is not read; choose \"Export Cameras\"",
            ),
            ("a.rsproj", b"", "Internal/External camera parameters"),
            ("block.xml", b"<?xml?><BlocksExchange version=\"3.2\">", "ContextCapture"),
            ("x_calibrated_external_camera_parameters.txt", b"", "Pix4D"),
        ] {
            let error = refused(&[(name, bytes)]);
            let text = error.to_string();
            assert!(error.exit_code() == 4 && text.contains(words) && text.contains(name), "{name}: {text}");
            assert!(!text.contains("no poses yet"), "{text}");
        }
        // Negative control: of other content, these are no poses.
        for name in ["bundle.out", "reconstruction.json", "notes.npy", "cameras.json", "block.xml"] {
            let error = refused(&[(name, b"nothing")]);
            assert!(error.exit_code() == 3 && error.to_string().contains("have no poses yet"), "{error}");
        }
    }

    #[test]
    fn a_file_that_the_user_names_is_told_like_one_in_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("model.nvm");
        std::fs::write(&file, "NVM_V3").unwrap();
        assert!(load(&file).err().unwrap().to_string().contains("VisualSFM"));
    }

    #[test]
    fn a_model_that_lacks_a_file_is_told_which() {
        let scene = Scene::ring(3);
        for (lost, is_text) in [("cameras", true), ("images", true), ("cameras", false), ("images", false)] {
            let folder = tempfile::tempdir().unwrap();
            let model = folder.path().join("sparse/0");
            match is_text {
                true => scene.write_text(&model),
                false => scene.write_binary(&model),
            }
            scene.write_photos(&folder.path().join("images"), (12, 8));
            assert_eq!(load(folder.path()).unwrap().views.len(), 3, "negative control");
            std::fs::remove_file(model.join(format!("{lost}.{}", if is_text { "txt" } else { "bin" })))
                .unwrap();
            let error = load(folder.path()).err().unwrap();
            let words = format!("neither \"{lost}.bin\" nor \"{lost}.txt\" is here; copy the whole model");
            assert!(error.exit_code() == 3 && error.to_string().contains(&words), "{error}");
        }
        let error = refused(&[("sparse/0/points3D.txt", b"")]);
        assert!(error.to_string().contains("\"cameras.txt\", and neither \"images.bin\""), "{error}");
        assert!(refused(&[("cameras.txt", b"a note")]).to_string().contains("have no poses yet"));
    }

    #[test]
    fn tables_in_another_encoding_are_told_how_to_save_them() {
        let table = "#name,x,y,alt,heading,pitch,roll,f,px,py\np01.png,0,0,0,0,0,0,36,0,0\n";
        let utf16: Vec<u8> = table.encode_utf16().flat_map(u16::to_le_bytes).collect();
        for (bytes, words) in [
            (table.replace(',', ";").into_bytes(), "separated by semicolons"),
            (table.replace(',', "\t").into_bytes(), "separated by tabs"),
            (utf16, "in UTF-16 without a byte order mark"),
        ] {
            let error = refused(&[("cameras.csv", &bytes)]);
            assert!(error.exit_code() == 4 && error.to_string().contains(words), "{error}");
        }
        let error = refused(&[("cameras.csv", b"name;size\n")]);
        assert!(error.to_string().contains("have no poses yet"), "negative control: {error}");
    }
}
