//! The `litetex` command.

fn main() {}
