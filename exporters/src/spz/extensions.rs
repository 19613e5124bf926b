//! Records of extensions: a type, a length and as many bytes, one after the other. In version 4 they stand between header and
//! table of contents, before that behind the streams. A flag of the header announces them; ours needs none.

use super::coordinates::Coordinates;

/// Bit of the header's flags: there are records.
pub const HAS_EXTENSIONS: u8 = 0x2;
/// Type of our record, which holds the metadata as JSON. Other programs skip it by the place of the table.
pub const META_RECORD: u32 = 0x4c54_0001;
/// `SPZ_ADOBE_safe_orbit_camera`: how far viewers may turn. Nothing of it is read, and nothing lost but that.
const SAFE_ORBIT: u32 = 0xadbe_0002;
/// `SPZ_ADOBE_coordinate_system`: the coordinates in which the splats are stored, as a u32.
const COORDINATES: u32 = 0xadbe_0003;

/// What the records of a file say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extensions {
    /// Our metadata, as JSON.
    pub meta: Option<Vec<u8>>,
    /// The coordinates of the splats, if they are not those that the format prescribes.
    pub coordinates: Option<Coordinates>,
    /// What is odd about the records.
    pub warnings: Vec<String>,
}

impl Extensions {
    /// Reads records up to the first that is cut. Those of others count only if the header announces them.
    pub fn parse(mut rest: &[u8], flags: u8) -> Self {
        let mut found = Self::default();
        let is_announced = flags & HAS_EXTENSIONS != 0;
        let (mut num_unknown, mut has_coordinates) = (0, false);
        while let Some((kind, value, after)) = record(rest) {
            rest = after;
            match kind {
                META_RECORD if found.meta.is_none() && value.len() <= crate::asset::meta::META_BYTES_MAX => {
                    found.meta = Some(value.to_vec());
                }
                META_RECORD | SAFE_ORBIT => {}
                COORDINATES if !has_coordinates => {
                    has_coordinates = true;
                    found.take_coordinates(value, is_announced);
                }
                COORDINATES => {}
                _ if is_announced => {
                    num_unknown += 1;
                    if num_unknown == 1 {
                        let what = format!(
                            "the record of an unknown extension, {kind:#010x}, is not read: the splats may be meant otherwise"
                        );
                        found.warnings.push(what);
                    }
                }
                _ => {}
            }
        }
        if is_announced && !rest.is_empty() {
            found.warnings.push(format!("{} bytes of its extension records are damaged", rest.len()));
        }
        found
    }

    fn take_coordinates(&mut self, value: &[u8], is_announced: bool) {
        let code = value.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
        let Some(coordinates) = code.and_then(Coordinates::from_code) else {
            let found = code.map_or_else(|| format!("{} bytes", value.len()), |code| code.to_string());
            self.warnings.push(format!(
                "its extension record states coordinates that are not known ({found}, expected 1 to 16): read as right, up, back (RUB)"
            ));
            return;
        };
        if coordinates.is_prescribed() {
            return;
        }
        let name = coordinates.name();
        if is_announced {
            self.warnings.push(format!(
                "its splats are stored in the coordinates {name}, as an extension record says: they were turned; programs that \
                 do not know the extension show them otherwise"
            ));
            self.coordinates = Some(coordinates);
        } else {
            self.warnings.push(format!(
                "an extension record states the coordinates {name}, but the header announces no records: read as right, up, back \
                 (RUB)"
            ));
        }
    }
}

/// Type and value of the first record, and what follows it.
fn record(bytes: &[u8]) -> Option<(u32, &[u8], &[u8])> {
    let (kind, rest) = bytes.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (value, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    Some((u32::from_le_bytes(*kind), value, rest))
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// The record of Adobe's extension.
    pub fn coordinates_record(code: u32) -> Vec<u8> {
        [COORDINATES, 4, code].iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    #[test]
    fn records_are_read_in_any_order_and_odd_ones_reported() {
        let of = |kind: u32, value: &[u8]| {
            [&kind.to_le_bytes(), &(value.len() as u32).to_le_bytes(), value].concat()
        };
        let [unknown, orbit, meta] =
            [of(0x1234_0001, &[7; 5]), of(SAFE_ORBIT, &[0; 12]), of(META_RECORD, b"{}")];
        let rdf = coordinates_record(6);
        let all = [&unknown[..], &orbit, &rdf, &meta].concat();
        let found = Extensions::parse(&all, HAS_EXTENSIONS);
        assert_eq!(found.meta.as_deref(), Some(&b"{}"[..]));
        assert_eq!(found.coordinates.map(Coordinates::name), Some("RDF"));
        let has = |found: &Extensions, words: &str| found.warnings.iter().any(|w| w.contains(words));
        assert!(has(&found, "0x12340001") && has(&found, "RDF") && found.warnings.len() == 2, "{found:?}");
        // One record counts, and is told of once, however many follow.
        let repeated = Extensions::parse(&[&rdf[..], &rdf, &coordinates_record(17)].concat(), HAS_EXTENSIONS);
        assert_eq!((repeated.coordinates, repeated.warnings.len()), (found.coordinates, 1));
        // Nothing announces them: ours is read, nothing is turned.
        let silent = Extensions::parse(&all, 0);
        assert_eq!((&silent.meta, silent.coordinates), (&found.meta, None));
        assert!(has(&silent, "announces no records") && silent.warnings.len() == 1, "{silent:?}");
        // The coordinates that the format prescribes, none, and those of no meaning.
        assert_eq!(Extensions::parse(&coordinates_record(4), HAS_EXTENSIONS), Extensions::default());
        for record in [coordinates_record(0), coordinates_record(17), of(COORDINATES, &[6, 0])] {
            let found = Extensions::parse(&record, HAS_EXTENSIONS);
            assert!(found.coordinates.is_none() && has(&found, "not known"), "{found:?}");
        }
        assert!(has(&Extensions::parse(&rdf[..11], HAS_EXTENSIONS), "11 bytes"));
        assert_eq!(Extensions::parse(&orbit, HAS_EXTENSIONS), Extensions::default());
    }
}
