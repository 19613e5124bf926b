//! How exactly a file keeps an asset.

/// How exactly a file keeps a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Keeps every number bit for bit.
    Lossless,
    /// Loses at most 0.02 dB on average.
    #[default]
    Balanced,
    /// Loses at most 0.1 dB on average.
    Tiny,
    /// Rounded to a size or loss that the user chose, or not measured: nothing is guaranteed.
    Custom,
}

impl Quality {
    /// All qualities, best first.
    pub const ALL: [Self; 4] = [Self::Lossless, Self::Balanced, Self::Tiny, Self::Custom];

    /// The name in commands and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lossless => "lossless",
            Self::Balanced => "balanced",
            Self::Tiny => "tiny",
            Self::Custom => "custom",
        }
    }

    /// The quality with a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name)
    }
}
