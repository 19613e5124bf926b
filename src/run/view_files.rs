//! Files of evaluated and rendered views: their names, images, error maps and the table of figures.

use crate::backend::RenderedImage;
use crate::eval::{Evaluation, error_map, quantised};
use crate::image::{Channels, write_png};
use crate::views::ViewSource;
use crate::{Error, Result, atomic_file, input_file};
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the table with the figures of each view.
pub const PER_VIEW: &str = "per_view.csv";
/// First line of the table.
const PER_VIEW_HEAD: &str = "name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip,psnr_corrected,uncovered";
/// Folder of the error maps.
pub const ERROR_MAPS: &str = "error";
/// Largest table that is read.
const TABLE_BYTES_MAX: u64 = 1 << 28;

/// Writes a rendered view and its error map below `folder`, under the photo's name.
///
/// # Errors
/// [`Error::Io`], or what decoding the photo found.
pub fn write_view(folder: &Path, views: &dyn ViewSource, view: usize, image: &RenderedImage) -> Result<()> {
    let name = image_name(views, view);
    let target = views.target(view)?;
    let put = |path: PathBuf, rgb: &[u8]| {
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        write_png(&path, image.width_px, image.height_px, Channels::Rgb, rgb)
    };
    put(folder.join(&name), &quantised(&image.rgb))?;
    put(folder.join(ERROR_MAPS).join(&name), &error_map(&image.rgb, &target))
}

/// File name for images of a view: the photo's with the extension `png`, or with `png` appended where two photos
/// differ only in their extension. Never leads out of the folder.
pub fn image_name(views: &dyn ViewSource, view: usize) -> PathBuf {
    let name = views.name(view);
    let stem = |name: &str| Path::new(name).with_extension("");
    let shared = (0..views.num_views()).any(|v| v != view && stem(views.name(v)) == stem(name));
    let [plain, appended] = image_names(name);
    if shared { appended } else { plain }
}

/// The names that images of a view may have, see [`image_name`]: by themselves, views do not tell which it is.
pub fn image_names(name: &str) -> [PathBuf; 2] {
    let plain = Path::new(name).with_extension("");
    [format!("{}.png", plain.display()), format!("{name}.png")].map(|name| inner_path(&name))
}

/// The path below a folder that a name means; never leads out of it.
fn inner_path(name: &str) -> PathBuf {
    let parts = name.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | ".."));
    parts.map(|part| part.replace(':', "_")).collect()
}

/// Writes the figures of each view as a table, `PER_VIEW`.
///
/// # Errors
/// [`Error::Io`].
pub fn write_per_view(folder: &Path, evaluation: &Evaluation) -> Result<()> {
    let mut text = format!("{PER_VIEW_HEAD}\n");
    for v in &evaluation.per_view {
        let name = if v.name.contains([',', '"', '\n']) {
            format!("\"{}\"", v.name.replace('"', "\"\""))
        } else {
            v.name.clone()
        };
        let known = |figure: Option<f64>| figure.map_or(String::new(), |f| f.to_string());
        let [corrected, uncovered] = [v.psnr_corrected, v.uncovered].map(known);
        text.push_str(&format!(
            "{name},{},{},{},{},{},{corrected},{uncovered}\n",
            v.psnr, v.grad_psnr, v.ssim_3dgs, v.ssim_valid, v.flip
        ));
    }
    Ok(atomic_file::write(&folder.join(PER_VIEW), text.as_bytes())?)
}

/// Names of the views in the table that [`write_per_view`] wrote into a folder; `None` if there is no such table.
pub fn views_of_table(folder: &Path) -> Option<Vec<String>> {
    let path = folder.join(PER_VIEW);
    if path.is_symlink() {
        return None;
    }
    let text = input_file::read_text(&path, TABLE_BYTES_MAX).ok()?;
    let mut rows = text.strip_prefix(PER_VIEW_HEAD)?.strip_prefix('\n')?;
    let mut names = Vec::new();
    while !rows.is_empty() {
        let (name, figures) = first_field(rows)?;
        names.push(name);
        rows = figures.split_once('\n').map_or("", |(_, rest)| rest);
    }
    Some(names)
}

/// The first field of a row and what follows it.
fn first_field(row: &str) -> Option<(String, &str)> {
    let Some(quoted) = row.strip_prefix('"') else {
        let (name, rest) = row.split_once(',')?;
        return Some((name.to_owned(), rest));
    };
    // A quote in a name is doubled.
    let mut from = 0;
    loop {
        let end = from + quoted[from..].find('"')?;
        match quoted[end + 1..].strip_prefix('"') {
            Some(_) => from = end + 2,
            None => return Some((quoted[..end].replace("\"\"", "\""), &quoted[end + 1..])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::ViewQuality;

    #[test]
    fn names_of_views_are_read_back_from_the_table() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(views_of_table(folder.path()), None);
        let names = ["a/0001.jpg", "one, \"two\"\nthree.jpg", "\"", "ü.png"];
        let of_view = |name: &str| ViewQuality {
            name: name.to_owned(),
            psnr: 20.5,
            grad_psnr: 20.5,
            ssim_3dgs: 0.5,
            ssim_valid: 0.5,
            flip: 0.5,
            psnr_corrected: None,
            uncovered: Some(0.5),
        };
        let evaluation = Evaluation::from_views(names.map(of_view).to_vec()).unwrap();
        write_per_view(folder.path(), &evaluation).unwrap();
        assert_eq!(views_of_table(folder.path()).unwrap(), names);
        // Tables of others.
        for text in ["", "x", "name,psnr\na,1\n", &format!("{PER_VIEW_HEAD}\n\"a\n")] {
            fs::write(folder.path().join(PER_VIEW), text).unwrap();
            assert_eq!(views_of_table(folder.path()), None, "{text}");
        }
    }
}
