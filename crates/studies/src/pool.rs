//! Many small things played side by side, each on a thread of execution of its own, so that one that panics or hangs is
//! no more than that.

use indicatif::{ProgressBar, ProgressStyle};
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How one ended.
#[derive(Debug)]
pub enum Ended<T> {
    /// With an answer.
    Well(T),
    /// It panicked.
    Panicked,
    /// It did not come back in time, and is left to itself.
    Hung,
}

/// Does this on a thread of its own and waits no longer than `limit`.
pub fn apart<T: Send + 'static>(limit: Duration, work: impl FnOnce() -> T + Send + 'static) -> Ended<T> {
    let (tell, hear) = channel();
    let worker = std::thread::spawn(move || {
        // Nobody hears of it when the time is up.
        let _ = tell.send(work());
    });
    match hear.recv_timeout(limit) {
        Ok(answer) => Ended::Well(answer),
        Err(RecvTimeoutError::Timeout) => Ended::Hung,
        Err(RecvTimeoutError::Disconnected) => {
            let _ = worker.join();
            Ended::Panicked
        }
    }
}

/// Plays these numbers, `jobs` at a time, and hands each answer to `take`, in any order; what that says is printed
/// above a bar.
pub fn play<T: Send + 'static>(
    numbers: Range<u64>,
    jobs: u16,
    limit: Duration,
    work: impl Fn(u64) -> T + Clone + Send + Sync + 'static,
    take: impl FnMut(u64, Ended<T>) -> Option<String> + Send,
) {
    let bar = ProgressBar::new(numbers.end.saturating_sub(numbers.start));
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {pos} of {len}, {eta} left {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    let (next, take) = (AtomicU64::new(numbers.start), Mutex::new(take));
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= numbers.end {
                        return;
                    }
                    let work = work.clone();
                    let ended = apart(limit, move || work(number));
                    if let Some(line) = take.lock().expect("nothing panics while it is held")(number, ended) {
                        // A bar that is not drawn prints nothing.
                        bar.suspend(|| eprintln!("{line}"));
                    }
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
}
