//! cpu (to be filled).
