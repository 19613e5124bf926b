//! `litetex man`: manual pages from the same tree as the help.

use clap::{Command, CommandFactory};
use litetex_gs::{Error, atomic_file};
use std::io::Write;
use std::path::PathBuf;

/// Print the manual page, or write the pages of all commands into a folder
#[derive(clap::Args)]
pub struct ManArgs {
    /// Write litetex.1, litetex-train.1, ... here instead
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Prints or writes the pages.
pub fn run(args: &ManArgs) -> anyhow::Result<()> {
    let mut command = super::Cli::command();
    command.build();
    let Some(folder) = &args.out else {
        std::io::stdout().write_all(&page(command)?)?;
        return Ok(());
    };
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    for sub in command.get_subcommands() {
        let name = format!("litetex-{}", sub.get_name());
        let sub = sub.clone().name(name.clone());
        atomic_file::write(&folder.join(format!("{name}.1")), &page(sub)?)?;
    }
    atomic_file::write(&folder.join("litetex.1"), &page(command)?)?;
    Ok(())
}

fn page(command: Command) -> std::io::Result<Vec<u8>> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command).render(&mut text)?;
    Ok(text)
}
