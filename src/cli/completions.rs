//! `litetex completions`: shell completions, from the same definitions as the help.

use litetex_gs::Result;
use litetex_gs::console::Output;

/// Print completions for a shell
///
/// For example: litetex completions bash > ~/.local/share/bash-completion/completions/litetex
#[derive(clap::Args)]
pub struct CompletionsArgs {
    /// Shell to complete for
    shell: clap_complete::Shell,
}

/// Prints the completions for `command`, the whole program.
pub fn run(args: &CompletionsArgs, mut command: clap::Command) -> Result<Output> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "litetex", &mut text);
    Ok(Output::text(String::from_utf8_lossy(&text)))
}
