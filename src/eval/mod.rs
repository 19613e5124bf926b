//! eval (to be filled).
