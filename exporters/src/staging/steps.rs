//! The steps of a move.

/// The steps of a move. Tests stop after some of them, as if the process were killed: then every further step fails.
#[derive(Debug, Default)]
pub(super) struct Steps {
    #[cfg(test)]
    pub left: std::cell::Cell<Option<usize>>,
}

impl Steps {
    /// Does a step.
    pub fn run<T>(&self, step: impl FnOnce() -> std::io::Result<T>) -> std::io::Result<T> {
        #[cfg(test)]
        if let Some(left) = self.left.get() {
            self.left.set(Some(left.saturating_sub(1)));
            if left == 0 {
                return Err(std::io::Error::other("killed"));
            }
        }
        step()
    }
}
