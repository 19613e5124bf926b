//! Photos as COLMAP and training read them: upright JPEG or PNG files. EXIF data come from the originals.

use super::camera::Camera;
use super::child::{Command, Observer};
use super::exif::Exif;
use super::heif;
use super::input::Named;
use super::tools::Tools;
use crate::capture::extensions::is_of;
use crate::{Error, Result, atomic_file, input_file};
use image::codecs::jpeg::JpegEncoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// A photo larger than this is refused.
const FILE_BYTES_MAX: u64 = 1 << 30;

/// Quality of photos that are written anew: their loss is below that of a phone's own JPEG files.
const JPEG_QUALITY: u8 = 95;

/// How a photo gets into the capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// As it is: an upright JPEG or PNG file.
    Copied,
    /// Decoded and written upright.
    Rewritten,
    /// Decoded by another program first.
    Converted,
}

/// A photo that was looked at, not yet converted.
#[derive(Clone, Debug)]
pub struct Photo {
    file: PathBuf,
    /// Name in the capture.
    pub name: String,
    /// Upright.
    pub size: (u32, u32),
    exif: Exif,
    way: Way,
}

impl Photo {
    /// Reads the header of a photo.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`], [`Error::Unsupported`].
    pub fn look(named: &Named) -> Result<Self> {
        let file = &named.file;
        let bytes = input_file::read(file, FILE_BYTES_MAX)?;
        if bytes.get(4..8) == Some(b"ftyp") {
            let header = heif::read(&bytes).ok_or_else(|| {
                invalid!(file, "the header is broken or holds no photo; export it again as JPEG")
            })?;
            // The program that decodes it turns it.
            let exif = Exif { orientation: 1, ..Exif::read(&header.exif) };
            let name = format!("{}.jpg", named.stem);
            return Ok(Self { file: file.clone(), name, size: header.size, exif, way: Way::Converted });
        }
        if is_of(file, &["exr"]) {
            return Err(unsupported!(
                file,
                "an OpenEXR photo; expected photos as cameras write them, such as JPEG"
            ));
        }
        let broken = |e| invalid!(file, "not a photo that can be read: {e}");
        let reader =
            ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(|e| Error::io(file, e))?;
        let format = reader.format();
        let mut decoder = reader.into_decoder().map_err(broken)?;
        let exif = match format {
            // The file itself is the structure that EXIF data have.
            Some(ImageFormat::Tiff) => Exif::read(&bytes),
            _ => Exif::read(&decoder.exif_metadata().ok().flatten().unwrap_or_default()),
        };
        let (width, height) = decoder.dimensions();
        let size = if exif.orientation > 4 { (height, width) } else { (width, height) };
        let (extension, is_kept) = match format {
            Some(ImageFormat::Jpeg) => ("jpg", true),
            Some(ImageFormat::Png) => ("png", true),
            _ => ("jpg", false),
        };
        let way = if is_kept && exif.orientation <= 1 { Way::Copied } else { Way::Rewritten };
        let extension = if way == Way::Rewritten { "jpg" } else { extension };
        Ok(Self { file: file.clone(), name: format!("{}.{extension}", named.stem), size, exif, way })
    }

    /// The original.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Whether another program has to decode it.
    pub fn is_converted(&self) -> bool {
        self.way == Way::Converted
    }

    /// Whether a person needs ImageMagick for [`Self::write`].
    pub fn is_rewritten(&self) -> bool {
        self.way == Way::Rewritten
    }

    /// The command that a person would use for [`Self::write`], to a file of this path.
    pub fn by_hand(&self, tools: &Tools, to: &Path) -> String {
        let (file, to) = (self.file.as_path(), to.to_path_buf());
        match self.way {
            Way::Copied => Command::new("cp").arg(file).arg(to).shell(),
            Way::Converted => tools.heif_command(file, &to).shell(),
            Way::Rewritten => tools.turn_command(file, &to).shell(),
        }
    }

    /// Puts the photo into a folder, upright.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`], [`Error::Unsupported`] if what another program decoded is not the whole photo.
    pub fn write(&self, folder: &Path, tools: &Tools, log: &Path, observer: &dyn Observer) -> Result<()> {
        let to = folder.join(&self.name);
        if let Some(inner) = to.parent() {
            std::fs::create_dir_all(inner).map_err(|e| Error::io(inner, e))?;
        }
        if self.way == Way::Copied {
            return Ok(atomic_file::write(&to, &input_file::read(&self.file, FILE_BYTES_MAX)?)?);
        }
        let mut image = if self.way == Way::Converted {
            self.decoded(&to.with_extension("decoded"), tools, log, observer)?
        } else {
            open(&self.file)?
        };
        if let Some(turn) = Orientation::from_exif(self.exif.orientation) {
            image.apply_orientation(turn);
        }
        let mut bytes = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
        image
            .into_rgb8()
            .write_with_encoder(encoder)
            .map_err(|e| Error::io(&to, std::io::Error::other(e)))?;
        Ok(atomic_file::write(&to, &bytes)?)
    }

    /// The photo as another program decodes it, which may write several images of one file, numbered, in a `folder` of its own.
    fn decoded(
        &self,
        folder: &Path,
        tools: &Tools,
        log: &Path,
        observer: &dyn Observer,
    ) -> Result<DynamicImage> {
        let of_folder = |e| Error::io(folder, e);
        // An interrupted run may have left images of another file.
        if folder.exists() {
            std::fs::remove_dir_all(folder).map_err(of_folder)?;
        }
        std::fs::create_dir_all(folder).map_err(of_folder)?;
        let command = tools.heif_command(&self.file, &folder.join("image.png"));
        command.run(log, observer, |_| {}).map_err(|e| match e {
            Error::Device(what) => invalid!(&self.file, "could not be decoded: {what}"),
            other => other,
        })?;
        let entries = std::fs::read_dir(folder).map_err(of_folder)?;
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.sort_by_key(|file| (file.as_os_str().len(), file.clone()));
        let (mut sizes, mut photo) = (Vec::new(), None);
        for file in &files {
            let image = open(file)?;
            sizes.push(format!("{} x {}", image.width(), image.height()));
            if (image.width(), image.height()) == self.size {
                photo = Some(image);
                break;
            }
        }
        std::fs::remove_dir_all(folder).map_err(of_folder)?;
        photo.ok_or_else(|| {
            unsupported!(
                &self.file,
                "{} decoded {} px of a photo of {} x {}, so it does not know all of this format: update it, or export \
                 the photo as JPEG",
                tools.heif_name(),
                if sizes.is_empty() { "nothing".into() } else { sizes.join(" and ") },
                self.size.0,
                self.size.1
            )
        })
    }
}

fn open(path: &Path) -> Result<DynamicImage> {
    let bytes = input_file::read(path, FILE_BYTES_MAX)?;
    let reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| Error::io(path, e))?;
    reader.decode().map_err(|e| invalid!(path, "the photo cannot be decoded: {e}"))
}

/// One camera for each device, focal length and size: photos of a phone's wide and normal lens have different ones.
pub fn cameras(photos: &[Photo]) -> Vec<Camera> {
    let key =
        |p: &Photo| (p.exif.device.clone(), p.exif.focal_mm.or(p.exif.focal_35_mm).map(f64::to_bits), p.size);
    let mut found: Vec<(_, Camera)> = Vec::new();
    for photo in photos {
        let own = key(photo);
        match found.iter_mut().find(|(key, _)| *key == own) {
            Some((_, camera)) => camera.names.push(photo.name.clone()),
            None => {
                let camera = Camera {
                    focal_px: photo.exif.focal_px(photo.size),
                    size: photo.size,
                    names: vec![photo.name.clone()],
                };
                found.push((own, camera));
            }
        }
    }
    found.into_iter().map(|(_, camera)| camera).collect()
}
