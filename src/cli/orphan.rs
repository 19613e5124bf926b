//! `--end-with-stdin`: trainings end with the benchmark that started them, even if it is killed: their results would be lost, and a
//! restarted benchmark would repeat them while they still run.

use std::io::Read;

/// Ends this process as soon as standard input does: the other end is held by the benchmark, and the system closes it
/// whatever ends the benchmark. What the run has written so far is of no use and is left to the next benchmark.
pub fn end_with_stdin() {
    std::thread::spawn(|| {
        let mut buffer = [0; 64];
        let mut stdin = std::io::stdin();
        // Errors mean the same as an end.
        while matches!(stdin.read(&mut buffer), Ok(1..)) {}
        std::process::exit(130);
    });
}
