//! Sidecar files of a `.gltf`: their names, also as URIs, and finding them without leaving the folder.

use crate::{Error, Result, quoted};
use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};

/// The file's name without extension, which URIs of sidecar files contain.
///
/// # Errors
/// [`Error::Invalid`] if it is not UTF-8.
pub fn stem(path: &Path) -> Result<&str> {
    let stem = path.file_stem().and_then(|s| s.to_str());
    stem.ok_or_else(|| Error::invalid(path, "the file's name must be UTF-8, because URIs contain it"))
}

/// Name of the sidecar file with all arrays.
pub fn arrays_name(stem: &str) -> String {
    format!("{stem}.bin")
}

/// Name of the sidecar file with an atlas page.
pub fn page_name(stem: &str, page: usize, extension: &str) -> String {
    format!("{stem}_atlas_{page}.{extension}")
}

/// A file name as a relative URI.
pub fn uri_from_name(name: &str) -> String {
    let mut uri = String::new();
    for byte in name.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => uri.push(char::from(byte)),
            // Writing to a string cannot fail.
            _ => drop(write!(uri, "%{byte:02X}")),
        }
    }
    uri
}

/// The path that a relative URI stands for; `None` if an escape is broken.
fn name_from_uri(uri: &str) -> Option<String> {
    let (mut bytes, mut rest) = (Vec::new(), uri.bytes());
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digits = [rest.next()?, rest.next()?];
            let text =
                std::str::from_utf8(&digits).ok().filter(|t| t.bytes().all(|b| b.is_ascii_hexdigit()))?;
            bytes.push(u8::from_str_radix(text, 16).ok()?);
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}

/// The path of the file that a URI names.
///
/// # Errors
/// [`Error::Unsupported`] for data and network URIs, [`Error::Invalid`] for those that leave the folder of `path`.
pub fn resolve(uri: &str, path: &Path) -> Result<PathBuf> {
    let shown = quoted(uri);
    if uri.contains(':') {
        let what = format!("URI {shown}: only files next to the .gltf are read, no data or network URIs");
        return Err(Error::unsupported(path, what));
    }
    let leaves = || invalid!(path, "URI {shown} does not name a file in the .gltf's folder");
    let name = name_from_uri(uri).filter(|n| !n.is_empty() && !n.contains(['\0', '\\', ':']));
    let name = PathBuf::from(name.ok_or_else(leaves)?);
    if !name.components().all(|c| matches!(c, Component::Normal(_))) {
        return Err(leaves());
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let file = folder.join(name);
    // Links are followed, but must end in the folder.
    let [real_folder, real_file] = [folder, &file].map(|p| p.canonicalize().map_err(|e| Error::io(p, e)));
    if !real_file?.starts_with(real_folder?) {
        return Err(leaves());
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_round_trip_through_uris() {
        for name in ["plain.bin", "with space.bin", "ü%2e#?.png", "a:b"] {
            let uri = uri_from_name(name);
            assert!(uri.is_ascii() && !uri.contains([' ', ':', '#', '?']), "{uri}");
            assert_eq!(name_from_uri(&uri).as_deref(), Some(name));
        }
        for broken in ["a%2", "a%zz", "%", "%+1", "%ff"] {
            assert_eq!(name_from_uri(broken), None, "{broken}");
        }
    }

    #[test]
    fn only_files_in_the_folder_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("inside");
        std::fs::create_dir_all(inside.join("sub")).unwrap();
        for name in ["outside.bin", "inside/a b.bin", "inside/sub/c.bin"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let gltf = inside.join("scene.gltf");
        assert!(resolve("a%20b.bin", &gltf).is_ok() && resolve("sub/c.bin", &gltf).is_ok());
        let absolute = inside.join("a b.bin").display().to_string();
        for uri in [
            "../outside.bin",
            "sub/../../outside.bin",
            "%2e%2e/outside.bin",
            "",
            ".",
            "a\\b",
            "a%00",
            &absolute,
        ] {
            assert!(matches!(resolve(uri, &gltf), Err(Error::Invalid { .. })), "{uri:?}");
        }
        for uri in ["data:;base64,AAAA", "https://example.org/a.bin", "file:///etc/passwd"] {
            assert!(matches!(resolve(uri, &gltf), Err(Error::Unsupported { .. })), "{uri:?}");
        }
        assert!(matches!(resolve("none.bin", &gltf), Err(Error::Io { .. })));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(folder.path().join("outside.bin"), inside.join("link.bin")).unwrap();
            assert!(matches!(resolve("link.bin", &gltf), Err(Error::Invalid { .. })));
        }
    }
}
