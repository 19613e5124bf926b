//! The setting `init`: where the initial splats are placed, as typed and as written to `config.toml`.

use crate::capture::{Capture, read_ply_points};
use crate::init::InitPoints;
use crate::views::SfmPoint;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Random points unless the user says how many.
const RANDOM_POINTS: usize = 20_000;

/// Most random points that can be requested.
const RANDOM_POINTS_MAX: usize = 10_000_000;

/// Where the initial splats are placed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum InitSource {
    /// At the capture's points, with more from the photos where it has few; at random ones if there are none.
    #[default]
    Auto,
    /// At the capture's points.
    Sfm,
    /// At the points of a PLY file, in the capture's frame.
    Ply(PathBuf),
    /// At this many random points in the views.
    Random(usize),
}

/// Points as [`InitSource`] has them, and the file that they are from.
pub struct ResolvedPoints<'a> {
    source: PointSource<'a>,
    /// The file.
    pub file: &'a Path,
}

enum PointSource<'a> {
    Given(Cow<'a, [SfmPoint]>),
    Made(InitPoints<'static>),
}

impl ResolvedPoints<'_> {
    /// As initialisation takes them.
    pub fn as_input(&self) -> InitPoints<'_> {
        match &self.source {
            PointSource::Given(points) => InitPoints::Sparse(points),
            PointSource::Made(points) => *points,
        }
    }
}

impl InitSource {
    /// The points, read from a file where that is requested.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] if the capture has no points but `sfm` asks for them; errors of reading the file.
    pub fn resolve<'a>(&'a self, capture: &'a Capture) -> Result<ResolvedPoints<'a>> {
        let poses = capture.poses.as_path();
        let given = |points, file| Ok(ResolvedPoints { source: PointSource::Given(points), file });
        let made = |points| Ok(ResolvedPoints { source: PointSource::Made(points), file: poses });
        match self {
            Self::Sfm if capture.points.is_empty() => Err(Error::invalid(
                poses,
                "the capture has no points; start from random points (random:COUNT)",
            )),
            Self::Auto if capture.points.is_empty() => made(InitPoints::Missing(RANDOM_POINTS)),
            Self::Auto | Self::Sfm => given(Cow::Borrowed(&capture.points), poses),
            Self::Ply(path) => given(Cow::Owned(read_ply_points(path)?), path),
            Self::Random(count) => made(InitPoints::Random(*count)),
        }
    }
}

impl FromStr for InitSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.split_once(':')) {
            ("auto", _) => Ok(Self::Auto),
            ("sfm", _) => Ok(Self::Sfm),
            ("random", _) => Ok(Self::Random(RANDOM_POINTS)),
            (_, Some(("ply", path))) if !path.is_empty() => Ok(Self::Ply(path.into())),
            (_, Some(("random", count))) => match count.parse() {
                Ok(count @ 1..=RANDOM_POINTS_MAX) => Ok(Self::Random(count)),
                _ => Err(format!("{text:?}: expected random:COUNT with COUNT from 1 to 10,000,000")),
            },
            _ => Err(format!(
                "{text:?}: expected \"auto\", \"sfm\", \"random\", \"random:COUNT\" or \"ply:FILE\""
            )),
        }
    }
}

impl fmt::Display for InitSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Sfm => f.write_str("sfm"),
            Self::Ply(path) => write!(f, "ply:{}", path.display()),
            Self::Random(count) => write!(f, "random:{count}"),
        }
    }
}

impl TryFrom<String> for InitSource {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<InitSource> for String {
    fn from(source: InitSource) -> Self {
        source.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::LoadOptions;
    use crate::sample::{SampleOptions, write_sample};

    fn sample(folder: &Path) -> Capture {
        let options = SampleOptions {
            views: 3,
            width_px: 32,
            height_px: 24,
            supersampling: 1,
            points: 50,
            ..SampleOptions::default()
        };
        write_sample(folder, &options).unwrap();
        Capture::load(folder, &LoadOptions::default()).unwrap()
    }

    #[test]
    fn sources_round_trip_as_text() {
        for text in ["auto", "sfm", "random:77", "ply:a/b.ply"] {
            assert_eq!(text.parse::<InitSource>().unwrap().to_string(), text);
        }
        assert_eq!("random".parse(), Ok(InitSource::Random(20_000)));
        for wrong in ["", "ply:", "random:0", "random:x", "points"] {
            assert!(wrong.parse::<InitSource>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn auto_finds_points_if_the_capture_has_none() {
        let folder = tempfile::tempdir().unwrap();
        let mut capture = sample(folder.path());
        let count = capture.points.len();
        let resolved = InitSource::Auto.resolve(&capture).unwrap();
        assert!(matches!(resolved.as_input(), InitPoints::Sparse(points) if points.len() == count));
        capture.points.clear();
        let resolved = InitSource::Auto.resolve(&capture).unwrap();
        assert!(matches!(resolved.as_input(), InitPoints::Missing(RANDOM_POINTS)));
        assert!(matches!(InitSource::Sfm.resolve(&capture), Err(Error::InvalidInput { .. })));
    }

    #[test]
    fn points_from_a_file_replace_those_of_the_capture() {
        let folder = tempfile::tempdir().unwrap();
        let capture = sample(folder.path());
        let path = folder.path().join("start.ply");
        let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                   property float z\nend_header\n0.5 0 0\n";
        std::fs::write(&path, ply).unwrap();
        let source = InitSource::Ply(path.clone());
        let resolved = source.resolve(&capture).unwrap();
        assert_eq!(resolved.file, path);
        let InitPoints::Sparse([point]) = resolved.as_input() else { panic!("one point") };
        assert_eq!(point.position_in_capture.to_array(), [0.5, 0.0, 0.0]);
    }
}
