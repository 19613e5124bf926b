//! The loop behind a batch of trainings, in `litetex train A B C` and in `litetex-lab bench`: it does one after the other, or
//! several at a time, goes on after failures, and hands over each result as it comes, so that what is written grows with it.

use crate::{Error, Result};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// How an item of the list ended.
#[derive(Debug)]
pub enum Outcome<O> {
    /// The next one may begin. What failed in itself ends so too.
    GoOn(O),
    /// No other may begin.
    Last(O),
    /// Nothing came of it.
    Nothing,
}

/// Does `work` for each item in `jobs` threads, and calls `take` on this thread with each result, in the order in which they
/// end. No item begins once `is_stopped` says so, or after an error.
///
/// # Errors
/// [`Error::Interrupted`] if `is_stopped` says so at the end; the first error of `work` and `take`, which stops the others.
pub fn work_through<T: Sync, O: Send>(
    items: &[T],
    jobs: usize,
    is_stopped: &(dyn Fn() -> bool + Sync),
    work: impl Fn(&T) -> Result<Outcome<O>> + Sync,
    mut take: impl FnMut(O) -> Result<()>,
) -> Result<()> {
    if jobs == 1 {
        // In order: a result is taken before the next item begins.
        for item in items {
            if is_stopped() {
                break;
            }
            match work(item)? {
                Outcome::GoOn(result) => take(result)?,
                Outcome::Nothing => {}
                Outcome::Last(result) => {
                    take(result)?;
                    break;
                }
            }
        }
        return if is_stopped() { Err(Error::Interrupted) } else { Ok(()) };
    }
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    let one_after_another = |sender: mpsc::Sender<Result<O>>| {
        while !stop.load(Ordering::SeqCst) && !is_stopped() {
            let Some(item) = items.get(next.fetch_add(1, Ordering::SeqCst)) else { break };
            let outcome = work(item);
            if matches!(outcome, Err(_) | Ok(Outcome::Last(_))) {
                stop.store(true, Ordering::SeqCst);
            }
            let result = match outcome {
                Ok(Outcome::GoOn(result) | Outcome::Last(result)) => Ok(result),
                Ok(Outcome::Nothing) => continue,
                Err(error) => Err(error),
            };
            if sender.send(result).is_err() {
                break;
            }
        }
    };
    std::thread::scope(|scope| -> Result<()> {
        for _ in 0..jobs.min(items.len()) {
            let sender = sender.clone();
            scope.spawn(|| one_after_another(sender));
        }
        drop(sender);
        for result in &receiver {
            result.and_then(&mut take).inspect_err(|_| stop.store(true, Ordering::SeqCst))?;
        }
        Ok(())
    })?;
    if is_stopped() { Err(Error::Interrupted) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// Works through 0 to 9 and returns what was taken, in order.
    fn taken(
        jobs: usize,
        is_stopped: &(dyn Fn() -> bool + Sync),
        work: impl Fn(&u32) -> Result<Outcome<u32>> + Sync,
    ) -> (Vec<u32>, Result<()>) {
        let mut taken = Vec::new();
        let items: Vec<u32> = (0..10).collect();
        let outcome = work_through(&items, jobs, is_stopped, work, |result| {
            taken.push(result);
            Ok(())
        });
        taken.sort_unstable();
        (taken, outcome)
    }

    #[test]
    fn all_is_done_by_any_number_of_threads() {
        for jobs in [1, 3, 50] {
            let (all, outcome) = taken(jobs, &|| false, |&x| Ok(Outcome::GoOn(x)));
            assert!(all == (0..10).collect::<Vec<_>>() && outcome.is_ok(), "{all:?}");
        }
        assert!(work_through(&[0; 0], 3, &|| false, |&x: &u32| Ok(Outcome::GoOn(x)), |_| Ok(())).is_ok());
    }

    #[test]
    fn the_last_one_is_taken_and_what_came_to_nothing_is_not() {
        let until_four = |&x: &u32| Ok(if x == 4 { Outcome::Last(x) } else { Outcome::GoOn(x) });
        assert_eq!(taken(1, &|| false, until_four).0, [0, 1, 2, 3, 4]);
        let odd = |&x: &u32| Ok(if x % 2 == 0 { Outcome::Nothing } else { Outcome::GoOn(x) });
        assert_eq!(taken(1, &|| false, odd).0, [1, 3, 5, 7, 9]);
    }

    #[test]
    fn errors_and_interrupts_stop_it() {
        let fails = |&x: &u32| if x == 2 { Err(usage!("two")) } else { Ok(Outcome::GoOn(x)) };
        let (before, outcome) = taken(1, &|| false, fails);
        assert!(before == [0, 1] && outcome.unwrap_err().exit_code() == 2, "{before:?}");
        let done = Mutex::new(0);
        let is_stopped = || *done.lock().unwrap() == 3;
        let (before, outcome) = taken(1, &is_stopped, |&x| {
            *done.lock().unwrap() += 1;
            Ok(Outcome::GoOn(x))
        });
        assert!(before == [0, 1, 2] && outcome.unwrap_err().exit_code() == 130, "{before:?}");
        let mut tries = 0;
        let full = work_through(
            &[1, 2, 3],
            1,
            &|| false,
            |&x| Ok(Outcome::GoOn(x)),
            |_| {
                tries += 1;
                Err(usage!("the disk is full"))
            },
        );
        assert!(full.is_err() && tries == 1);
    }
}
