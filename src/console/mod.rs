//! What the programs `litetex` and `litetex-lab` share at the command line: the door through which a process enters and
//! leaves, messages, tables, values as typed, Ctrl-C, and devices by name. Only this module and the programs use clap and print.

mod common_args;
pub mod device;
mod door;
mod free_files;
mod interrupt;
mod log;
mod output;
mod table;
pub mod values;

pub use common_args::CommonArgs;
pub use door::{Program, enter};
pub use free_files::check_free;
pub use interrupt::Interrupt;
pub use log::{Log, LogFormat, write_line};
pub use output::Output;
pub use table::{Table, columns, path_text, serialize_path};
