//! What the programs `litetex` and `litetex-lab` share at the command line: the door through which a process enters and
//! leaves, messages, tables, values as typed, Ctrl-C, and devices by name. Only this module and the programs use clap and print.

mod common_args;
pub mod device;
mod door;
mod interrupt;
mod log;
mod outputs;
mod table;
pub mod values;

pub use common_args::CommonArgs;
pub use door::{Program, enter, with_numbers_as_values};
pub use interrupt::Interrupt;
pub use log::{Log, LogFormat, write_line};
pub use outputs::check_free;
pub use table::{Columns, Table, path_text, print_columns, print_json, serialize_path};
