//! reference (to be filled).
