//! The connections that are open. There is room for a few; where it ends, the one that has waited longest without a request
//! gives way, so that clients that send nothing cannot keep others out.

use std::collections::VecDeque;
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most connections at a time; a browser opens six.
const MOST: usize = 32;

/// The open connections.
#[derive(Clone, Default)]
pub struct Connections(Arc<Mutex<State>>);

#[derive(Default)]
struct State {
    next: u64,
    /// Those without a request yet, the oldest first.
    waiting: VecDeque<(u64, TcpStream)>,
    /// Those that are being answered.
    answered: usize,
}

/// A place among the connections, free again when dropped.
pub struct Place {
    connections: Connections,
    number: u64,
    is_answered: bool,
}

impl Connections {
    /// A place for a new connection; `None` if all are being answered.
    pub fn enter(&self, stream: &TcpStream) -> Option<Place> {
        let handle = stream.try_clone().ok()?;
        let mut state = self.state();
        if state.answered >= MOST {
            return None;
        }
        if state.answered + state.waiting.len() >= MOST
            && let Some((_, oldest)) = state.waiting.pop_front()
        {
            // Its thread finds the connection closed.
            let _ = oldest.shutdown(Shutdown::Both);
        }
        let number = state.next;
        state.next += 1;
        state.waiting.push_back((number, handle));
        drop(state);
        Some(Place { connections: self.clone(), number, is_answered: false })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// The request is there: from now on the connection does not give way.
    pub fn answer(&mut self) {
        let mut state = self.connections.state();
        state.waiting.retain(|(number, _)| *number != self.number);
        state.answered += usize::from(!self.is_answered);
        self.is_answered = true;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut state = self.connections.state();
        state.waiting.retain(|(number, _)| *number != self.number);
        state.answered -= usize::from(self.is_answered);
    }
}
