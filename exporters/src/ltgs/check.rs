//! What is wrong with a file, each with a number that stays.

use super::read::Reader;
use crate::{Error, Issue, ReadLimits, Severity};
use std::path::Path;

/// Everything that can be found wrong: tables, every block's checksum and content, bounds, hash.
///
/// | code | meaning |
/// |---|---|
/// | `LT3001` | no `.ltgs` file, or its header, metadata or table of contents is damaged |
/// | `LT3002` | of a later version, or with a feature that this program does not know |
/// | `LT3003` | larger than the reader's limits |
/// | `LT3004` | a chunk is damaged |
/// | `LT3005` | a centre lies outside of its chunk's bounds |
/// | `LT3006` | the content has another hash than the file says |
/// | `LT3007` | of a later minor version: what it added is ignored |
/// | `LT3008` | the splats make no valid asset |
pub fn validate(bytes: &[u8], path: &Path) -> Vec<Issue> {
    let reader = match Reader::open(bytes, path, &ReadLimits::default()) {
        Ok(reader) => reader,
        Err(error) => return vec![issue_of("LT3001", "", &error)],
    };
    let mut issues = Vec::new();
    for chunk in 0..reader.num_chunks() {
        let place = format!("chunk {chunk}");
        match reader.decode_chunk(chunk, true) {
            Err(error) => issues.push(issue_of("LT3004", &place, &error)),
            Ok((asset, _)) => {
                let [low, high] = reader.entries[chunk].bounds;
                let inside = |p: &&[f32; 3]| (0..3).all(|i| (low[i]..=high[i]).contains(&p[i]));
                let outside = asset.positions.len() - asset.positions.iter().filter(inside).count();
                if outside > 0 {
                    let what = format!("{outside} centres lie outside of {low:?} to {high:?}");
                    issues.push(issue("LT3005", Severity::Error, &place, what));
                }
            }
        }
    }
    if issues.iter().any(|i| i.code == "LT3004") {
        return issues;
    }
    match reader.decode() {
        Err(error) => issues.push(issue_of("LT3008", "", &error)),
        Ok(contents) => {
            let found = contents.asset.hash();
            if contents.hash != Some(found) {
                let what = format!("hash {found:016x}, stated {:?}", reader.meta.hash);
                issues.push(issue("LT3006", Severity::Error, "metadata", what));
            }
            issues
                .extend(contents.warnings.into_iter().map(|w| issue("LT3007", Severity::Info, "header", w)));
        }
    }
    issues
}

fn issue(code: &'static str, severity: Severity, place: &str, message: String) -> Issue {
    Issue { code, severity, place: place.to_owned(), message }
}

/// An error as an issue; families that are no damage have numbers of their own.
fn issue_of(code: &'static str, place: &str, error: &Error) -> Issue {
    let code = match error {
        Error::Unsupported { .. } => "LT3002",
        Error::TooLarge { .. } => "LT3003",
        _ => code,
    };
    let message = match error {
        Error::Invalid { what, .. } | Error::Unsupported { what, .. } | Error::TooLarge { what, .. } => {
            what.clone()
        }
        other => other.to_string(),
    };
    issue(code, Severity::Error, place, message)
}
