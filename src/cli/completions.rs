//! `litetex completions`: shell completions, from the same definitions as the help.

use std::io::Write;

/// Print completions for a shell
///
/// For example: litetex completions bash > ~/.local/share/bash-completion/completions/litetex
#[derive(clap::Args)]
pub struct CompletionsArgs {
    /// Shell to complete for
    shell: clap_complete::Shell,
}

/// Prints the completions for `command`, the whole program.
pub fn run(args: &CompletionsArgs, mut command: clap::Command) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "litetex", &mut text);
    std::io::stdout().write_all(&text)?;
    Ok(())
}
