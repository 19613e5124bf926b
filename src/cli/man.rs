//! `litetex man`: manual pages, from the same definitions as the help.

use clap::Command;
use litetex_gs::console::{Output, check_free, path_text};
use litetex_gs::{Error, Result, atomic_file};
use serde_json::json;
use std::path::PathBuf;

/// Print the manual page, or write the pages of all commands into a folder
#[derive(clap::Args)]
pub struct ManArgs {
    /// Write litetex.1, litetex-train.1 and so on into this folder instead
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite existing pages
    #[arg(long, requires = "out")]
    force: bool,
}

/// Prints or writes the pages of `command`, the whole program.
pub fn run(args: &ManArgs, mut command: Command) -> Result<Output> {
    command.build();
    let Some(folder) = &args.out else {
        return Ok(Output::text(page(command)?));
    };
    let subcommands = command.get_subcommands().map(|sub| {
        let name = format!("litetex-{}", sub.get_name());
        (folder.join(format!("{name}.1")), sub.clone().name(name))
    });
    let pages: Vec<(PathBuf, Command)> =
        subcommands.chain([(folder.join("litetex.1"), command.clone())]).collect();
    let files: Vec<PathBuf> = pages.iter().map(|(file, _)| file.clone()).collect();
    check_free(&files, args.force)?;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    for (file, command) in pages {
        atomic_file::write(&file, page(command)?.as_bytes())?;
    }
    let files: Vec<String> = files.iter().map(|file| path_text(file)).collect();
    Ok(Output::new("litetex-man/1", json!({ "files": files }), ""))
}

fn page(command: Command) -> Result<String> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command).render(&mut text).map_err(|e| Error::io("manual page", e))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}
