//! A training in a process of its own, so that its memory is free before the next one begins, and a crash ends nothing else.

use serde_json::Value;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{BufRead as _, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Interval at which a process is polled.
const POLL: Duration = Duration::from_millis(20);
/// After a Ctrl-C ended a run, time within which this process gets its own.
const INTERRUPT_GRACE: Duration = Duration::from_millis(500);
/// Exit codes of an interrupted training, and of arguments that cannot be meant so.
const INTERRUPTED: i32 = 130;
const USAGE: i32 = 2;
/// What Rust programs write when they crash.
const PANICS: [&str; 2] = ["panicked at", "memory allocation of"];
/// Lines of messages that are kept, and characters of them in the message of a failed run.
const LINES_KEPT: usize = 40;
const MESSAGE_CHARS_MAX: usize = 2000;

/// A program to run until it ends.
pub struct Process<'a> {
    /// The program.
    pub program: &'a Path,
    /// Its arguments.
    pub args: Vec<OsString>,
    /// Time after which it is killed.
    pub timeout_secs: Option<f64>,
    /// Whether it must end.
    pub is_stopped: &'a (dyn Fn() -> bool + Sync),
    /// How it is ended then.
    pub stop: Stop,
    /// Gets each line that the process writes to standard error.
    pub on_line: &'a mut (dyn FnMut(&str) + Send),
}

/// How a process is ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// At once.
    Kill,
    /// By the end of its standard input, which it must obey; it may take its time to save what it has.
    EndOfInput,
}

/// How a process ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// By itself, with this exit code and, unless that is 0, this message.
    Exit(Option<i32>, String),
    /// By the timeout.
    TimedOut,
    /// By the user.
    Interrupted,
}

impl Process<'_> {
    /// Runs the program. Its standard input stays open until then, and is closed by the system when this process ends,
    /// however it ends.
    ///
    /// # Errors
    /// Those of the system.
    pub fn run(self) -> std::io::Result<End> {
        let mut child = Command::new(self.program)
            .args(&self.args)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let said = child.stderr.take();
        let on_line = &mut *self.on_line;
        let (stop, timeout_secs, is_stopped) = (self.stop, self.timeout_secs, self.is_stopped);
        std::thread::scope(|scope| {
            let reader = scope.spawn(move || said.map(|said| read_lines(said, on_line)).unwrap_or_default());
            let waited = wait(&mut child, stop, timeout_secs, is_stopped);
            if waited.is_err() {
                // The reader ends with the process.
                let _ = child.kill();
            }
            let lines = reader.join().unwrap_or_default();
            let (how, status) = waited?;
            Ok(match how {
                Some(end) => end,
                None => End::Exit(status.code(), message(&lines, status)),
            })
        })
    }
}

/// Waits for the end of a process: its status, and what ended it if it was not the process itself.
fn wait(
    child: &mut Child,
    stop: Stop,
    timeout_secs: Option<f64>,
    is_stopped: &dyn Fn() -> bool,
) -> std::io::Result<(Option<End>, ExitStatus)> {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            // Ctrl-C goes to both processes; the other may be quicker.
            let waited = Instant::now();
            let may_be = status.code().is_none_or(|code| code == INTERRUPTED);
            while may_be && !is_stopped() && waited.elapsed() < INTERRUPT_GRACE {
                std::thread::sleep(POLL);
            }
            let interrupted = !status.success() && is_stopped();
            return Ok((interrupted.then_some(End::Interrupted), status));
        }
        if is_stopped() {
            match stop {
                Stop::Kill => {
                    child.kill()?;
                    return Ok((Some(End::Interrupted), child.wait()?));
                }
                Stop::EndOfInput => drop(child.stdin.take()),
            }
        }
        if timeout_secs.is_some_and(|limit| started.elapsed().as_secs_f64() > limit) {
            child.kill()?;
            return Ok((Some(End::TimedOut), child.wait()?));
        }
        std::thread::sleep(POLL);
    }
}

/// Hands over each line until the end, and returns the last ones.
fn read_lines(said: impl Read, on_line: &mut (dyn FnMut(&str) + Send)) -> VecDeque<String> {
    let (mut said, mut bytes, mut lines) = (BufReader::new(said), Vec::new(), VecDeque::new());
    while said.read_until(b'\n', &mut bytes).is_ok_and(|count| count > 0) {
        let line = String::from_utf8_lossy(&bytes).trim_end_matches(['\n', '\r']).to_owned();
        on_line(&line);
        lines.push_back(line);
        if lines.len() > LINES_KEPT {
            lines.pop_front();
        }
        bytes.clear();
    }
    lines
}

/// Why a process failed: the signal that ended it, or the error that it wrote.
fn message(lines: &VecDeque<String>, status: ExitStatus) -> String {
    let code = status.code();
    let said = error_in(lines, code).map(|said| said.chars().take(MESSAGE_CHARS_MAX).collect::<String>());
    match (code, said) {
        (Some(0), _) => String::new(),
        (Some(_), Some(said)) => said,
        (Some(code), None) => format!("exit code {code} without a message"),
        // It comes from outside: no line of the process is its reason.
        (None, _) if status.to_string().contains("SIGKILL") => {
            format!("killed by the system ({status}); out of memory?")
        }
        // A crash, which may have said why.
        (None, said) => {
            format!(
                "ended by the system ({status}){}",
                said.map_or_else(String::new, |said| format!(": {said}"))
            )
        }
    }
}

/// The last error of our own among messages, as text or as JSON, without its mark; or the beginning of a panic. Libraries and drivers
/// write lines that begin with `error:` and go on; of ours, only those about arguments do, and only they end with that exit code.
fn error_in(lines: &VecDeque<String>, code: Option<i32>) -> Option<String> {
    let of_json = |line: &String| {
        let event: Value = serde_json::from_str(line).ok().filter(|_| line.starts_with('{'))?;
        (event["event"] == "error").then(|| event["message"].as_str().unwrap_or_default().to_owned())
    };
    if let Some(message) = lines.iter().rev().find_map(of_json) {
        return Some(message);
    }
    let is_reason = |line: &String| {
        let is_marked = line.starts_with("error[") || code == Some(USAGE);
        is_marked && without_mark(line).is_some() || PANICS.iter().any(|words| line.contains(words))
    };
    let at = lines.iter().rposition(is_reason)?;
    // A message may have several lines, for example about a mistake in a TOML file.
    let text = lines.range(at..).map(String::as_str).collect::<Vec<_>>().join("\n");
    Some(without_mark(&text).unwrap_or(&text).trim().to_owned())
}

/// The text of an error, `error: TEXT` or `error[KIND]: TEXT`.
pub fn without_mark(text: &str) -> Option<&str> {
    let rest = text.strip_prefix("error")?;
    match rest.strip_prefix('[') {
        Some(rest) => rest.split_once("]: ").map(|(_, text)| text),
        None => rest.strip_prefix(": "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_error_is_found_among_messages() {
        let with = |said: &str, code| error_in(&said.lines().map(str::to_owned).collect(), code);
        let of = |said: &str| with(said, Some(3));
        let usage = "error: unexpected argument\n\nUsage: litetex";
        assert_eq!(with(usage, Some(2)).as_deref(), usage.strip_prefix("error: "));
        // What a driver wrote before the training began.
        let driver = "error: no desktop\nstep 1/3";
        assert_eq!([of(driver), with(driver, None)], [None, None]);
        assert_eq!(of(&format!("{driver}\nerror[io]: a: no\nmore")).as_deref(), Some("a: no\nmore"));
        assert_eq!(of("warning[x]: y\nerror[usage]: a: no").as_deref(), Some("a: no"));
        assert_eq!(of("{\"event\":\"error\",\"message\":\"m\"}\n{}").as_deref(), Some("m"));
        assert_eq!(
            of("thread 'main' panicked at x:1:\nboo").as_deref(),
            Some("thread 'main' panicked at x:1:\nboo")
        );
        assert_eq!([of("step 1/3"), of(""), of("errors: 3")], [None, None, None]);
    }

    #[cfg(unix)]
    #[test]
    fn processes_end_by_themselves_by_time_and_by_the_user() {
        let run = |script: &str, timeout_secs: Option<f64>, is_stopped: bool, stop: Stop| {
            let mut lines = Vec::new();
            let process = Process {
                program: Path::new("sh"),
                args: ["-c", script].map(OsString::from).into(),
                timeout_secs,
                is_stopped: &|| is_stopped,
                stop,
                on_line: &mut |line| lines.push(line.to_owned()),
            };
            (process.run().unwrap(), lines)
        };
        let (end, lines) = run("echo a >&2; echo 'error[io]: b' >&2; exit 5", None, false, Stop::Kill);
        assert_eq!(end, End::Exit(Some(5), "b".to_owned()));
        assert_eq!(lines, ["a", "error[io]: b"]);
        assert_eq!(run("exit 0", None, false, Stop::Kill).0, End::Exit(Some(0), String::new()));
        let End::Exit(None, killed) = run("kill -9 $$", None, false, Stop::Kill).0 else { panic!() };
        assert!(killed.contains("signal"), "{killed}");
        let driver = "echo 'error: no desktop' >&2; echo step 1 >&2; kill";
        let ended = |signal: &str| match run(&format!("{driver} {signal} $$"), None, false, Stop::Kill).0 {
            End::Exit(None, message) => message,
            other => panic!("{other:?}"),
        };
        assert_eq!(ended("-9"), "killed by the system (signal: 9 (SIGKILL)); out of memory?");
        assert_eq!(ended("-11"), "ended by the system (signal: 11 (SIGSEGV))");
        let crash = "echo \"thread 'main' panicked at x\" >&2; ulimit -c 0; kill -6 $$";
        let End::Exit(None, crashed) = run(crash, None, false, Stop::Kill).0 else { panic!() };
        assert_eq!(crashed, "ended by the system (signal: 6 (SIGABRT)): thread 'main' panicked at x");
        assert_eq!(run("exec sleep 60", Some(0.1), false, Stop::Kill).0, End::TimedOut);
        assert_eq!(run("exec sleep 60", None, true, Stop::Kill).0, End::Interrupted);
        let (end, lines) = run("cat; echo saved >&2; exit 130", None, true, Stop::EndOfInput);
        assert_eq!((end, lines), (End::Interrupted, vec!["saved".to_owned()]));
        // Interrupted alone, by a signal of its own.
        assert!(matches!(run("exit 130", None, false, Stop::Kill).0, End::Exit(Some(130), _)));
    }
}
