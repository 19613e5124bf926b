//! What a photo's EXIF data (a TIFF structure, CIPA DC-008) say of the camera and of the way it was held.

/// Diagonal of a 35 mm frame, millimetres, to which equivalent focal lengths refer.
const DIAGONAL_35_MM: f64 = 43.27;

/// What we read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exif {
    /// Maker and model of the camera.
    pub device: String,
    /// 1 to 8; 1 is upright.
    pub orientation: u8,
    /// Focal length, millimetres: lenses of a phone differ in it.
    pub focal_mm: Option<f64>,
    /// Equivalent focal length, millimetres.
    pub focal_35_mm: Option<f64>,
}

impl Exif {
    /// Reads a TIFF structure; what is missing or broken is left out.
    pub fn read(tiff: &[u8]) -> Self {
        let mut found = Self { orientation: 1, ..Self::default() };
        let Some(tiff) = Tiff::new(tiff) else { return found };
        let main = tiff.entries(tiff.u32(4));
        let texts = [0x010f, 0x0110].map(|tag| main.iter().find(|e| e.tag == tag).and_then(|e| tiff.text(e)));
        found.device = texts.into_iter().flatten().collect::<Vec<_>>().join(" ");
        let number =
            |entries: &[Entry], tag| entries.iter().find(|e| e.tag == tag).and_then(|e| tiff.number(e));
        if let Some(turn) = number(&main, 0x0112).filter(|turn| (1.0..=8.0).contains(turn)) {
            found.orientation = turn as u8;
        }
        let inner = number(&main, 0x8769).map(|at| tiff.entries(Some(at as u32))).unwrap_or_default();
        let positive = |tag| number(&inner, tag).filter(|mm| (0.5..10_000.0).contains(mm));
        found.focal_mm = positive(0x920a);
        found.focal_35_mm = positive(0xa405);
        found
    }

    /// The focal length in pixels of a photo of this size.
    pub fn focal_px(&self, (width_px, height_px): (u32, u32)) -> Option<f64> {
        self.focal_35_mm.map(|mm| mm / DIAGONAL_35_MM * f64::from(width_px).hypot(height_px.into()))
    }
}

struct Tiff<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

struct Entry {
    tag: u16,
    kind: u16,
    count: u32,
    /// Offset of the field that holds the value, or where it is.
    at: usize,
}

impl<'a> Tiff<'a> {
    fn new(bytes: &'a [u8]) -> Option<Self> {
        let is_big_endian = match bytes.get(..4)? {
            b"II*\0" => false,
            b"MM\0*" => true,
            _ => return None,
        };
        Some(Self { bytes, is_big_endian })
    }

    fn u16(&self, at: usize) -> Option<u16> {
        let bytes: [u8; 2] = self.bytes.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&self, at: usize) -> Option<u32> {
        let bytes: [u8; 4] = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn entries(&self, at: Option<u32>) -> Vec<Entry> {
        let Some(at) = at.map(|at| at as usize) else { return Vec::new() };
        let count = self.u16(at).unwrap_or(0);
        let entry = |index: u16| {
            let at = at + 2 + 12 * usize::from(index);
            Some(Entry { tag: self.u16(at)?, kind: self.u16(at + 2)?, count: self.u32(at + 4)?, at: at + 8 })
        };
        (0..count).map_while(entry).collect()
    }

    fn number(&self, entry: &Entry) -> Option<f64> {
        match entry.kind {
            3 => self.u16(entry.at).map(f64::from),
            4 => self.u32(entry.at).map(f64::from),
            5 => {
                let at = self.u32(entry.at)? as usize;
                let (over, under) = (self.u32(at)?, self.u32(at.checked_add(4)?)?);
                (under > 0).then(|| f64::from(over) / f64::from(under))
            }
            _ => None,
        }
    }

    fn text(&self, entry: &Entry) -> Option<String> {
        let count = entry.count as usize;
        let at = if count <= 4 { entry.at } else { self.u32(entry.at)? as usize };
        let bytes = self.bytes.get(at..at.checked_add(count.min(200))?).filter(|_| entry.kind == 2)?;
        let text = String::from_utf8_lossy(bytes);
        Some(text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned()).filter(|t| !t.is_empty())
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// EXIF data of a phone's photo.
    pub fn exif_of(model: &str, orientation: u16, focal_35_mm: u16) -> Vec<u8> {
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        let entry = |tag: u16, kind: u16, count: u32, value: u32| {
            [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value.to_le_bytes()].concat()
        };
        bytes.extend(3_u16.to_le_bytes());
        // Three entries end at 8 + 2 + 36 + 4 = 50; the inner directory has one and ends at 68.
        bytes.extend(entry(0x0110, 2, model.len() as u32, 68));
        bytes.extend(entry(0x0112, 3, 1, orientation.into()));
        bytes.extend(entry(0x8769, 4, 1, 50));
        bytes.extend([0; 4]);
        bytes.extend(1_u16.to_le_bytes());
        bytes.extend(entry(0xa405, 3, 1, focal_35_mm.into()));
        bytes.extend([0; 4]);
        assert_eq!(bytes.len(), 68);
        bytes.extend(model.as_bytes());
        bytes
    }

    #[test]
    fn camera_turn_and_focal_length_are_read() {
        let found = Exif::read(&exif_of("Phone 15", 6, 26));
        assert_eq!((found.device.as_str(), found.orientation), ("Phone 15", 6));
        let focal_px = found.focal_px((4000, 3000)).unwrap();
        assert!((focal_px - 26.0 / 43.27 * 5000.0).abs() < 1.0, "{focal_px}");
        assert_eq!(Exif::read(b"II*\0"), Exif { orientation: 1, ..Exif::default() });
    }

    #[test]
    fn broken_data_are_left_out() {
        let whole = exif_of("Phone 15", 6, 26);
        for length in 0..whole.len() {
            let found = Exif::read(&whole[..length]);
            assert!([1, 6].contains(&found.orientation), "{length}");
        }
        for at in 0..whole.len() {
            let mut broken = whole.clone();
            broken[at] = 0xff;
            let _ = Exif::read(&broken);
        }
    }
}
