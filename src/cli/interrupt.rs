//! Ctrl-C (and termination): the first asks for an orderly end, the second ends at once.

use litetex_gs::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// The one that listens: a process has one handler.
static LISTENING: OnceLock<Interrupt> = OnceLock::new();

/// Whether the user asked to stop.
#[derive(Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Takes over Ctrl-C from the system, once.
    ///
    /// # Errors
    /// [`Error::Device`] if the system does not let us.
    pub fn listen() -> Result<Self> {
        if let Some(interrupt) = LISTENING.get() {
            return Ok(interrupt.clone());
        }
        let interrupt = Self::default();
        let flag = interrupt.clone();
        ctrlc::set_handler(move || {
            if flag.0.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        })
        .map_err(|e| Error::Device(format!("cannot listen to Ctrl-C: {e}")))?;
        Ok(LISTENING.get_or_init(|| interrupt).clone())
    }

    /// The one that listens; one that is never requested if none does.
    pub fn current() -> Self {
        LISTENING.get().cloned().unwrap_or_default()
    }

    /// Ends what takes long.
    ///
    /// # Errors
    /// [`Error::Interrupted`] after Ctrl-C.
    pub fn check(&self) -> Result<()> {
        if self.is_requested() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Whether Ctrl-C was pressed.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// As if Ctrl-C had been pressed.
    #[cfg(test)]
    pub fn request(&self) {
        self.0.store(true, Ordering::SeqCst);
    }
}
