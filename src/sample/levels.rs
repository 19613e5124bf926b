//! Names with levels, such as "noise:20", as options of `litetex sample` take them.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Kind, name, default level, smallest and largest level, meaning of the level. Equal bounds: there are no levels.
pub type Row<K> = (K, &'static str, f64, [f64; 2], &'static str);

/// A set of kinds with levels.
pub trait Kinds: Copy + PartialEq + 'static {
    /// The word for a kind in messages.
    const WORD: &'static str;
    /// All of them.
    const ROWS: &'static [Row<Self>];

    /// What is wrong with a level within its bounds, if anything.
    fn problem(self, _level: f64) -> Option<&'static str> {
        None
    }
}

/// A kind and its level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leveled<K> {
    /// The kind.
    pub kind: K,
    /// Its size, strength or angle, in the unit of the kind.
    pub level: f64,
}

impl<K: Kinds> Leveled<K> {
    /// A kind at its default level.
    pub fn of(kind: K) -> Self {
        Self { kind, level: row(kind).2 }
    }

    /// All kinds at their default levels.
    pub fn all() -> impl Iterator<Item = Self> {
        K::ROWS.iter().map(|row| Self { kind: row.0, level: row.2 })
    }

    /// The level if it is of this kind.
    pub(super) fn level_of(&self, kind: K) -> Option<f64> {
        (self.kind == kind).then_some(self.level)
    }

    /// Names, levels and defaults, for the help.
    pub fn help() -> String {
        let entries = K::ROWS.iter().map(|(_, name, default, [low, high], unit)| {
            if low == high { (*name).to_owned() } else { format!("{name}[:{default}] ({unit})") }
        });
        entries.collect::<Vec<_>>().join(", ")
    }
}

fn row<K: Kinds>(kind: K) -> &'static Row<K> {
    K::ROWS.iter().find(|row| row.0 == kind).unwrap_or(&K::ROWS[0])
}

impl<K: Kinds> FromStr for Leveled<K> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, level) = text.split_once(':').map_or((text, None), |(name, level)| (name, Some(level)));
        let Some(&(kind, _, default, [low, high], unit)) = K::ROWS.iter().find(|row| row.1 == name) else {
            return Err(format!("{name:?}: no such {}; there are {}", K::WORD, Self::help()));
        };
        let level = match level {
            None => default,
            Some(_) if low == high => return Err(format!("{text:?}: {name} has no levels")),
            Some(level) => level
                .parse()
                .ok()
                .filter(|level| (low..=high).contains(level))
                .ok_or_else(|| format!("{text:?}: expected a level of {low} to {high} ({unit})"))?,
        };
        match kind.problem(level) {
            None => Ok(Self { kind, level }),
            Some(what) => Err(format!("{text:?}: {what}")),
        }
    }
}

/// As [`FromStr`] reads it.
impl<K: Kinds> fmt::Display for Leveled<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (_, name, _, [low, high], _) = row(self.kind);
        if low == high { f.write_str(name) } else { write!(f, "{name}:{}", self.level) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NamedScene, SceneKind, Stress, StressKind};
    use super::*;

    fn round_trip<K: Kinds + fmt::Debug>(wrong: &[(&str, &str)]) {
        for one in Leveled::<K>::all() {
            assert_eq!(one.to_string().parse(), Ok(one));
        }
        for (text, part) in wrong {
            let error = text.parse::<Leveled<K>>().unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn names_and_levels_are_parsed_and_printed() {
        round_trip::<StressKind>(&[
            ("fog", "no such stress; there are none, noise[:10] (standard deviation, of 255), checker"),
            ("noise:-1", "expected a level of 0 to 100"),
            ("noise:nan", "expected a level"),
            ("mirror:1", "mirror has no levels"),
        ]);
        round_trip::<SceneKind>(&[
            ("fog", "no such scene; there are wall[:8] (colours along each side), flat"),
            ("wall:1", "expected a level of 2 to 64"),
            ("wall:2.5", "expected a whole number"),
            ("wall:nan", "expected a level"),
            ("quilt:1", "quilt has no levels"),
            ("poster:0", "expected a level of 1 to 12 (octaves"),
            ("poster:6.5", "expected a whole number of octaves"),
        ]);
        assert_eq!("noise:20".parse(), Ok(Stress { kind: StressKind::Noise, level: 20.0 }));
        assert_eq!("noise".parse(), Ok(Stress::of(StressKind::Noise)));
        assert_eq!("wall:16".parse(), Ok(NamedScene { kind: SceneKind::Wall, level: 16.0 }));
    }
}
