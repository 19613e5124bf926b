//! `litetex validate`: checks a file against the rules of its format.

use litetex_exporters::{Issue, Severity, validate_file};
use litetex_gs::Error;
use litetex_gs::console::{Table, path_text, print_json};
use std::path::PathBuf;

/// Check a file against the rules of its format
///
/// Lists numbered issues: errors, warnings and notes. Exit code 1 if there is an error.
#[derive(clap::Args)]
pub struct ValidateArgs {
    /// File to validate
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Checks and prints.
pub fn run(args: &ValidateArgs) -> anyhow::Result<()> {
    let issues = validate_file(&args.file).map_err(Error::from)?;
    let errors = issues.iter().filter(|i| i.severity == Severity::Error).count();
    if args.json {
        let of_issue = |i: &Issue| serde_json::json!({ "code": i.code, "severity": name(i.severity), "place": i.place, "message": i.message });
        print_json(&serde_json::json!({
            "schema": "litetex-validate/1",
            "file": path_text(&args.file),
            "valid": errors == 0,
            "issues": issues.iter().map(of_issue).collect::<Vec<_>>(),
        }))?;
    } else {
        let mut table = Table::default();
        for issue in &issues {
            let place = if issue.place.is_empty() { String::new() } else { format!("{}: ", issue.place) };
            table.row(
                &format!("{} {}", issue.code, name(issue.severity)),
                format!("{place}{}", issue.message),
            );
        }
        let verdict = if errors == 0 { "valid" } else { "not valid" };
        table.row(
            verdict,
            format!("{}: {errors} errors, {} issues in all", args.file.display(), issues.len()),
        );
        table.print()?;
    }
    if errors == 0 {
        return Ok(());
    }
    Err(Error::CheckFailed(format!("{}: breaks {errors} rules", args.file.display())).into())
}

fn name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Info => "info",
    }
}
