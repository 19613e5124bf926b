//! The `litetex` command. Everything happens in [`cli`]; the library does the work, and [`viewer`] serves the page of
//! `litetex view`.

mod cli;
mod viewer;

fn main() -> std::process::ExitCode {
    cli::main()
}
