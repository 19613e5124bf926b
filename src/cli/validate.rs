//! `litetex validate`: checks a file against the rules of its format.

use litetex_exporters::{Issue, Severity, validate_file};
use litetex_gs::console::{Output, Table, path_text};
use litetex_gs::text::counted;
use litetex_gs::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

/// Check a file against the rules of its format
///
/// Lists numbered issues: errors, warnings and notes. Exit code 1 if there is an error.
#[derive(clap::Args)]
pub struct ValidateArgs {
    /// File to validate
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Checks and prints.
pub fn run(args: &ValidateArgs) -> Result<Output> {
    let issues = validate_file(&args.file).map_err(Error::from)?;
    let errors = issues.iter().filter(|i| i.severity == Severity::Error).count();
    let of_issue = |i: &Issue| json!({ "code": i.code, "severity": name(i.severity), "place": i.place, "message": i.message });
    let found = json!({
        "file": path_text(&args.file),
        "valid": errors == 0,
        "issues": issues.iter().map(of_issue).collect::<Vec<_>>(),
    });
    let mut table = Table::default();
    for issue in &issues {
        let place = if issue.place.is_empty() { String::new() } else { format!("{}: ", issue.place) };
        table.row(&format!("{} {}", issue.code, name(issue.severity)), format!("{place}{}", issue.message));
    }
    let verdict = if errors == 0 { "valid" } else { "not valid" };
    let [of_errors, of_issues] =
        [(errors, "error"), (issues.len(), "issue")].map(|(n, noun)| counted(n, noun));
    table.row(verdict, format!("{}: {of_errors}, {of_issues} in all", args.file.display()));
    let failure = (errors > 0)
        .then(|| Error::CheckFailed(format!("{}: breaks {}", args.file.display(), counted(errors, "rule"))));
    Ok(Output::new("litetex-validate/1", found, table).failing(failure))
}

fn name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Info => "info",
    }
}
