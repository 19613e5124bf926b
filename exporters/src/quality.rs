//! How much of an asset a file keeps.

/// A profile of quality.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Every number comes back bit for bit.
    Lossless,
    /// At most 0.02 dB lost on average.
    #[default]
    Balanced,
    /// At most 0.1 dB lost on average.
    Tiny,
    /// Rounded as someone asked for, to a size or a loss, or without having been measured: it promises nothing.
    Custom,
}

impl Quality {
    /// All, best first.
    pub const ALL: [Self; 4] = [Self::Lossless, Self::Balanced, Self::Tiny, Self::Custom];

    /// Its name in commands and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lossless => "lossless",
            Self::Balanced => "balanced",
            Self::Tiny => "tiny",
            Self::Custom => "custom",
        }
    }

    /// By its name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name)
    }
}
