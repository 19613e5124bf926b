//! Validates `.ltgs` files, chunk by chunk and as a whole.

use super::read::Reader;
use crate::format::contents::Issues;
use crate::{Error, Issue, ReadLimits, quoted};
use std::path::Path;

/// Checks the tables, the checksum and content of every block, bounds and hash. Codes:
///
/// | code | meaning |
/// |---|---|
/// | `LT3001` | not a `.ltgs` file, or its header, metadata or table of contents is damaged |
/// | `LT3002` | of a later version, or with a feature that this program does not know |
/// | `LT3003` | larger than the reader's limits |
/// | `LT3004` | a chunk is damaged |
/// | `LT3005` | a centre lies outside its chunk's bounds |
/// | `LT3006` | the content has another hash than the file says |
/// | `LT3007` | of a later minor version, whose additions are ignored |
/// | `LT3008` | the splats do not make a valid asset |
/// | `LT3009` | the stand-in is damaged |
pub fn validate(bytes: &[u8], path: &Path) -> Vec<Issue> {
    let mut issues = Issues::default();
    match Reader::open(bytes, path, &ReadLimits::default()) {
        Ok(reader) => check(&reader, &mut issues),
        Err(error) => add(&mut issues, "LT3001", "", &error),
    }
    issues.list
}

fn check(reader: &Reader<'_>, issues: &mut Issues) {
    let mut chunks = Vec::new();
    for chunk in 0..reader.num_chunks() {
        let place = format!("chunk {chunk}");
        match reader.decode_chunk(chunk) {
            Err(error) => add(issues, "LT3004", &place, &error),
            Ok((asset, tally)) => {
                let [low, high] = reader.entries[chunk].bounds;
                let is_inside = |p: &&[f32; 3]| (0..3).all(|i| (low[i]..=high[i]).contains(&p[i]));
                let outside = asset.positions.len() - asset.positions.iter().filter(is_inside).count();
                if outside > 0 {
                    let what = format!("{outside} centres are outside {low:?} to {high:?}");
                    issues.error("LT3005", &place, what);
                }
                chunks.push((asset, tally));
            }
        }
    }
    if issues.list.iter().any(|i| i.code == "LT3004") {
        return;
    }
    if let Err(error) = reader.stand_in(&ReadLimits::default()) {
        return add(issues, "LT3009", "", &error);
    }
    match reader.assemble(chunks) {
        Err(error) => add(issues, "LT3008", "", &error),
        Ok(contents) => {
            let found = contents.asset.hash();
            if contents.hash != Some(found) {
                let what = format!("hash {found:016x}, stated {}", quoted(&reader.meta.hash));
                issues.error("LT3006", "metadata", what);
            }
            contents.warnings.iter().for_each(|warning| issues.info("LT3007", "header", warning));
        }
    }
}

/// Adds an error as an issue; families that are not damage have codes of their own.
fn add(issues: &mut Issues, code: &'static str, place: &str, error: &Error) {
    let code = match error {
        Error::Unsupported { .. } => "LT3002",
        Error::TooLarge { .. } => "LT3003",
        _ => code,
    };
    issues.error(code, place, error.text());
}
