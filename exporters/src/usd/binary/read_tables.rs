//! Reads the tables of a binary file.

use super::{HEADER_BYTES, MAGIC, Rep, SECTIONS, VERSION, codec};
use crate::{Error, ReadLimits, Result, quoted};
use std::ops::Range;
use std::path::Path;

/// Most entries of a table; our stages have a few thousand.
const ENTRIES_MAX: usize = 1 << 20;

/// Reads bytes from front to back.
#[derive(Clone)]
pub(super) struct Cursor<'a> {
    pub(super) rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], String> {
        let found = self.rest.len();
        let (bytes, rest) =
            self.rest.split_at_checked(count).ok_or_else(|| format!("{count} bytes needed, {found} left"))?;
        self.rest = rest;
        Ok(bytes)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut out = [0; N];
        out.copy_from_slice(self.bytes(N)?);
        Ok(out)
    }

    pub(super) fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// A count of 64 bits, of entries with at least `entry_bytes` each: the rest must be able to hold them.
    pub(super) fn count(&mut self, entry_bytes: usize) -> Result<usize, String> {
        let count = self.u64()?;
        let most = self.rest.len() / entry_bytes;
        usize::try_from(count)
            .ok()
            .filter(|&c| c <= most)
            .ok_or_else(|| format!("count {count}, but there is room for {most}"))
    }

    /// A length, and that many bytes.
    fn block(&mut self) -> Result<&'a [u8], String> {
        let length = self.count(1)?;
        self.bytes(length)
    }

    /// The count of entries of a compressed table.
    fn entries(&mut self) -> Result<usize, String> {
        let count = self.u64()?;
        // Compression takes at least a bit for 1,020 entries.
        let most = ENTRIES_MAX.min(self.rest.len().saturating_mul(1020));
        usize::try_from(count)
            .ok()
            .filter(|&c| c <= most)
            .ok_or_else(|| format!("{count} entries, at most {most}"))
    }

    fn ints(&mut self, count: usize) -> Result<Vec<i32>, String> {
        codec::decompress_ints(self.block()?, count)
    }
}

/// A path, by its parent and last element.
#[derive(Clone, Debug, Default)]
pub(super) struct PathNode {
    /// Index of the parent; the root is its own.
    pub(super) parent: u32,
    /// Token of the last element.
    pub(super) token: u32,
    pub(super) is_property: bool,
    /// Whether the table contains it.
    pub(super) is_known: bool,
}

/// An entry of the table of specs: a path, its set of fields and its kind.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spec {
    pub(super) path: u32,
    pub(super) set: u32,
    pub(super) kind: u32,
}

/// The tables of a file.
#[derive(Default)]
pub(super) struct ReadTables {
    pub(super) tokens: Vec<String>,
    /// Strings, as indices of tokens.
    pub(super) strings: Vec<u32>,
    pub(super) fields: Vec<(u32, Rep)>,
    pub(super) field_sets: Vec<u32>,
    pub(super) paths: Vec<PathNode>,
    pub(super) specs: Vec<Spec>,
    /// Bytes of the tables, the table of contents and the header.
    pub(super) num_bytes: u64,
}

impl ReadTables {
    pub(super) fn read(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Self> {
        let sections = sections(bytes, path)?;
        let mut tables = Self::default();
        let contents: u64 = 8 + 32 * sections.len() as u64;
        tables.num_bytes = HEADER_BYTES as u64 + contents;
        let text_max = usize::try_from(limits.decoded_bytes).unwrap_or(usize::MAX);
        for (name, range) in SECTIONS.into_iter().zip(sections) {
            tables.num_bytes += range.len() as u64;
            let mut cursor = Cursor { rest: &bytes[range] };
            match name {
                "TOKENS" => tables.read_tokens(&mut cursor, text_max),
                "STRINGS" => tables.read_strings(&mut cursor),
                "FIELDS" => tables.read_fields(&mut cursor),
                "FIELDSETS" => tables.read_field_sets(&mut cursor),
                "PATHS" => tables.read_paths(&mut cursor),
                _ => tables.read_specs(&mut cursor),
            }
            .map_err(|what| invalid!(path, "section {name}: {what}"))?;
        }
        Ok(tables)
    }

    /// The text of a token.
    pub(super) fn token(&self, index: u32) -> Result<&str, String> {
        let token = self.tokens.get(index as usize).map(String::as_str);
        token.ok_or_else(|| format!("token {index} of {}", self.tokens.len()))
    }

    /// The text of a string.
    pub(super) fn string(&self, index: u32) -> Result<&str, String> {
        let token = self.strings.get(index as usize);
        self.token(*token.ok_or_else(|| format!("string {index} of {}", self.strings.len()))?)
    }

    fn read_tokens(&mut self, cursor: &mut Cursor, text_max: usize) -> Result<(), String> {
        let count = cursor.entries()?;
        let length = cursor.u64()?;
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let text = codec::decompress(cursor.block()?, length.min(text_max))?;
        if text.len() != length {
            return Err(format!("{} bytes of text, expected {length}", text.len()));
        }
        // Counted before anything is allocated for them.
        let found = text.iter().filter(|&&b| b == 0).count();
        if found != count {
            return Err(format!("{found} tokens, expected {count}"));
        }
        for part in text.split(|&b| b == 0).take(count) {
            self.tokens.push(String::from_utf8(part.to_vec()).map_err(|e| format!("token: {e}"))?);
        }
        Ok(())
    }

    fn read_strings(&mut self, cursor: &mut Cursor) -> Result<(), String> {
        let count = cursor.count(4)?;
        self.strings = (0..count).map(|_| cursor.u32()).collect::<Result<_, _>>()?;
        Ok(())
    }

    fn read_fields(&mut self, cursor: &mut Cursor) -> Result<(), String> {
        let count = cursor.entries()?;
        let tokens = cursor.ints(count)?;
        let reps = codec::decompress(cursor.block()?, 8 * count)?;
        if reps.len() != 8 * count {
            return Err(format!("{} bytes of values for {count} fields", reps.len()));
        }
        let mut reps = Cursor { rest: &reps };
        for token in tokens {
            self.fields.push((token as u32, Rep(reps.u64()?)));
        }
        Ok(())
    }

    fn read_field_sets(&mut self, cursor: &mut Cursor) -> Result<(), String> {
        let count = cursor.entries()?;
        self.field_sets = cursor.ints(count)?.into_iter().map(|i| i as u32).collect();
        Ok(())
    }

    fn read_specs(&mut self, cursor: &mut Cursor) -> Result<(), String> {
        let count = cursor.entries()?;
        let (paths, sets, kinds) = (cursor.ints(count)?, cursor.ints(count)?, cursor.ints(count)?);
        let columns = paths.into_iter().zip(sets).zip(kinds);
        self.specs = columns
            .map(|((path, set), kind)| Spec { path: path as u32, set: set as u32, kind: kind as u32 })
            .collect();
        Ok(())
    }

    fn read_paths(&mut self, cursor: &mut Cursor) -> Result<(), String> {
        let count = cursor.entries()?;
        let encoded = cursor.entries()?;
        if encoded > count {
            return Err(format!("{encoded} encoded paths of {count}"));
        }
        let (paths, tokens, jumps) = (cursor.ints(encoded)?, cursor.ints(encoded)?, cursor.ints(encoded)?);
        self.paths = vec![PathNode::default(); count];
        // Entries whose siblings and parents are known.
        let mut open = if encoded > 0 { vec![(0_usize, None)] } else { Vec::new() };
        while let Some((mut place, mut parent)) = open.pop() {
            loop {
                let (Some(&path), Some(&token), Some(&jump)) =
                    (paths.get(place), tokens.get(place), jumps.get(place))
                else {
                    return Err(format!("entry {place} of {encoded}"));
                };
                let node = self.paths.get_mut(path as usize).filter(|_| path >= 0);
                let node = node
                    .filter(|n| !n.is_known)
                    .ok_or_else(|| format!("path {path}: no such path, or twice"))?;
                *node = PathNode {
                    parent: parent.unwrap_or(path as u32),
                    token: token.unsigned_abs(),
                    is_property: token < 0,
                    is_known: true,
                };
                // -2: nothing follows; -1: a child; 0: a sibling; more: a child, and a sibling at that distance.
                if jump > 0 {
                    open.push((place.saturating_add(jump as usize), parent));
                }
                match jump {
                    -2 => break,
                    0 if parent.is_none() => return Err("the root has a sibling".to_owned()),
                    0 => {}
                    _ => parent = Some(path as u32),
                }
                place += 1;
            }
        }
        Ok(())
    }
}

/// Places of the sections, in the order of [`SECTIONS`].
fn sections(bytes: &[u8], path: &Path) -> Result<Vec<Range<usize>>> {
    let invalid = |what: String| Error::invalid(path, what);
    if !bytes.starts_with(MAGIC) || bytes.len() < HEADER_BYTES {
        return Err(invalid("does not begin with the header of a binary USD file".to_owned()));
    }
    if bytes[8..11] != VERSION {
        let [found, ours] = [&bytes[8..11], &VERSION].map(|v| format!("{}.{}.{}", v[0], v[1], v[2]));
        let what =
            format!("version {found} of the binary format; supported: {ours}, which this program writes");
        return Err(Error::unsupported(path, what));
    }
    let mut cursor = Cursor { rest: &bytes[16..] };
    let at = cursor.u64().map_err(invalid)?;
    let rest = usize::try_from(at).ok().and_then(|at| bytes.get(at..));
    let rest = rest.ok_or_else(|| {
        invalid(format!(
            "table of contents at byte {at} of {}: the file is truncated or damaged",
            bytes.len()
        ))
    })?;
    let mut cursor = Cursor { rest };
    let count = cursor.u64().map_err(invalid)?;
    if count != SECTIONS.len() as u64 {
        return Err(invalid(format!("{count} sections, expected {}", SECTIONS.len())));
    }
    let mut sections = Vec::new();
    for expected in SECTIONS {
        let name: [u8; 16] = cursor.array().map_err(invalid)?;
        let name = String::from_utf8_lossy(name.split(|&b| b == 0).next().unwrap_or_default()).into_owned();
        if name != expected {
            return Err(invalid(format!("section {}, expected {expected:?}", quoted(&name))));
        }
        let (start, size) = (cursor.u64().map_err(invalid)?, cursor.u64().map_err(invalid)?);
        let end = start.checked_add(size).filter(|&end| end <= bytes.len() as u64);
        let end = end.ok_or_else(|| {
            invalid(format!("section {name:?}: {size} bytes at {start}, the file has {}", bytes.len()))
        })?;
        sections.push(start as usize..end as usize);
    }
    Ok(sections)
}
