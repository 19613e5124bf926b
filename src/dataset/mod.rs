//! dataset (to be filled).
