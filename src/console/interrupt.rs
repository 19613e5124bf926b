//! Ctrl-C and SIGTERM: the first requests an orderly stop and is acknowledged at once; a later one ends the process.

use super::log::{Log, LogFormat, write_line};
use crate::{Error, Result};
use serde_json::json;
use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// A process has one handler.
static LISTENING: OnceLock<Interrupt> = OnceLock::new();

/// Signals within this time after the answer to the first count as the same request: terminals and wrappers may
/// deliver Ctrl-C twice.
const SAME_REQUEST: Duration = Duration::from_millis(500);

/// Whether the user asked to stop.
#[derive(Clone, Default)]
pub struct Interrupt(Arc<State>);

#[derive(Default)]
struct State {
    requested: AtomicBool,
    /// What is being done about it, for the answer.
    doing: Mutex<&'static str>,
}

/// What a signal leads to.
#[derive(Debug, PartialEq, Eq)]
enum Reaction {
    Stop,
    Ignore,
    Abort,
}

impl Interrupt {
    /// Takes over Ctrl-C from the system. `doing` says what happens after the first one, as in "saving the run".
    ///
    /// # Errors
    /// [`Error::Device`] if the system does not allow it.
    pub fn listen(log: &Log, doing: &'static str) -> Result<Self> {
        if LISTENING.get().is_none() {
            let interrupt = Self::default();
            let (state, format) = (interrupt.clone(), log.format());
            let mut answered = None;
            ctrlc::set_handler(move || match reaction(answered, Instant::now()) {
                Reaction::Stop => {
                    state.0.requested.store(true, Ordering::SeqCst);
                    answer(format, *state.0.doing.lock().unwrap_or_else(PoisonError::into_inner));
                    answered = Some(Instant::now());
                }
                Reaction::Ignore => {}
                Reaction::Abort => std::process::exit(130),
            })
            .map_err(|e| Error::Device(format!("cannot install the Ctrl-C handler: {e}")))?;
            LISTENING.get_or_init(|| interrupt);
        }
        let interrupt = Self::current();
        *interrupt.0.doing.lock().unwrap_or_else(PoisonError::into_inner) = doing;
        Ok(interrupt)
    }

    /// The one that listens; if none does, one that is never requested.
    pub fn current() -> Self {
        LISTENING.get().cloned().unwrap_or_default()
    }

    /// # Errors
    /// [`Error::Interrupted`] after Ctrl-C.
    pub fn check(&self) -> Result<()> {
        if self.is_requested() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Whether Ctrl-C was pressed.
    pub fn is_requested(&self) -> bool {
        self.0.requested.load(Ordering::SeqCst)
    }

    /// As if Ctrl-C had been pressed. Where nobody listens there is nothing to save, and the process ends.
    pub fn request_or_exit() {
        match LISTENING.get() {
            Some(interrupt) => interrupt.0.requested.store(true, Ordering::SeqCst),
            None => std::process::exit(130),
        }
    }

    /// As if Ctrl-C had been pressed.
    #[cfg(test)]
    pub fn request(&self) {
        self.0.requested.store(true, Ordering::SeqCst);
    }
}

/// `answered`: when the first signal was answered, if there was one before.
fn reaction(answered: Option<Instant>, now: Instant) -> Reaction {
    match answered {
        None => Reaction::Stop,
        Some(at) if now.duration_since(at) < SAME_REQUEST => Reaction::Ignore,
        Some(_) => Reaction::Abort,
    }
}

/// Tells the user, even with `--quiet`, that the request was heard.
fn answer(format: LogFormat, doing: &str) {
    let message = format!("interrupted: {doing}; press Ctrl-C again to abort");
    // A terminal has echoed ^C and may show a progress bar.
    let start = if std::io::stderr().is_terminal() { "\n" } else { "" };
    let line = match format {
        LogFormat::Text => format!("{start}{message}"),
        LogFormat::Json => json!({ "event": "interrupted", "message": message }).to_string(),
    };
    write_line(&line);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_later_signal_aborts() {
        let answered = Instant::now();
        let after = |millis| reaction(Some(answered), answered + Duration::from_millis(millis));
        assert_eq!(reaction(None, answered), Reaction::Stop);
        assert_eq!([after(0), after(499)], [Reaction::Ignore, Reaction::Ignore]);
        assert_eq!([after(500), after(60_000)], [Reaction::Abort, Reaction::Abort]);
    }
}
