//! Trainings end with the process that started them, even if it is killed: a restarted one would repeat them while they still
//! run. The other end of their standard input is held by that process, and the system closes it whatever ends the process.

use litetex_gs::console::Interrupt;
use std::io::Read;

/// Ends this process as soon as standard input does (`--end-with-stdin`): what the run of a benchmark has written so far is of no
/// use and is left to the next benchmark.
pub fn end_with_stdin() {
    at_the_end_of_stdin(|| std::process::exit(130));
}

/// Interrupts this process as soon as standard input ends: the run of a batch is saved.
pub fn stop_with_stdin() {
    at_the_end_of_stdin(Interrupt::request_or_exit);
}

fn at_the_end_of_stdin(then: impl FnOnce() + Send + 'static) {
    std::thread::spawn(|| {
        let mut buffer = [0; 64];
        let mut stdin = std::io::stdin();
        // Errors mean the same as an end.
        while matches!(stdin.read(&mut buffer), Ok(1..)) {}
        then();
    });
}
