//! Names with levels, such as "noise:20", as options of `litetex sample` take them.

use std::fmt;

/// Kind, name, default level, smallest and largest level, meaning of the level. Equal bounds: there are no levels.
pub type Row<K> = (K, &'static str, f64, [f64; 2], &'static str);

/// Names, levels and defaults, for the help.
pub fn help<K>(rows: &[Row<K>]) -> String {
    let entries = rows.iter().map(|(_, name, default, [low, high], unit)| {
        if low == high { (*name).to_owned() } else { format!("{name}[:{default}] ({unit})") }
    });
    entries.collect::<Vec<_>>().join(", ")
}

/// Kind and level of a text; `what` is the word for the kinds in messages.
///
/// # Errors
/// A message that says what there is, or what level is expected.
pub fn parse<K: Copy>(rows: &[Row<K>], what: &str, text: &str) -> Result<(K, f64), String> {
    let (name, level) = text.split_once(':').map_or((text, None), |(name, level)| (name, Some(level)));
    let Some((kind, _, default, [low, high], unit)) = rows.iter().find(|row| row.1 == name) else {
        return Err(format!("{name:?}: no such {what}; there are {}", help(rows)));
    };
    let level = match level {
        None => *default,
        Some(_) if low == high => return Err(format!("{text:?}: {name} has no levels")),
        Some(level) => level
            .parse()
            .ok()
            .filter(|level| (*low..=*high).contains(level))
            .ok_or_else(|| format!("{text:?}: expected a level of {low} to {high} ({unit})"))?,
    };
    Ok((*kind, level))
}

/// Prints a kind and its level as [`parse`] reads them.
pub fn print<K>(
    (_, name, _, [low, high], _): &Row<K>,
    level: f64,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    if low == high { f.write_str(name) } else { write!(f, "{name}:{level}") }
}
