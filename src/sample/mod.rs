//! sample (to be filled).
