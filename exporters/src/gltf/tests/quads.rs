//! quads
