//! What the trainer knows of each splat besides its parameters.

/// Checks after which a splat is no longer fresh.
pub const FRESH_CHECKS: u16 = 2;

/// One splat's record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Life {
    /// Most texels a side that its map may have.
    pub ceiling: u16,
    /// Checks in a row that found it useless.
    pub marks: u16,
    /// Checks since it was born; saturates.
    pub checks: u16,
}

impl Life {
    /// A splat of the first model.
    pub fn first(ceiling: u16) -> Self {
        Self { ceiling, marks: 0, checks: FRESH_CHECKS }
    }

    /// A child of this.
    pub fn child(self) -> Self {
        Self { marks: 0, checks: 0, ..self }
    }

    /// Whether it is too young to be judged.
    pub fn is_fresh(self) -> bool {
        self.checks < FRESH_CHECKS
    }
}
