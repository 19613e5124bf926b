//! train (to be filled).
