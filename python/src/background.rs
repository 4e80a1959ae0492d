//! Long calls: other Python threads keep running, progress is reported, and Ctrl-C ends the call.

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::InternalError;

/// Interval between checks for signals.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// How long a call waits for work to stop. Work that takes longer continues in the background, and its result is discarded.
const PATIENCE: Duration = Duration::from_millis(500);

/// Stack size of a thread, bytes: the same as that of the program's main thread.
const STACK: usize = 8 << 20;

/// What the work sends to the waiting call.
enum Event<T> {
    /// Done and total, in units of the work.
    Progress(f64, f64),
    Ended(Result<T, Box<dyn Any + Send>>),
}

/// Passes progress to the waiting call, and its request to stop to the work.
pub struct Watch {
    stop: Arc<AtomicBool>,
    report: Box<dyn Fn(f64, f64) + Send + Sync>,
}

impl Watch {
    /// True once the work must stop.
    pub fn stop(&self) -> &AtomicBool {
        &self.stop
    }

    /// Reports `done` of `total` units and returns whether to continue.
    pub fn report(&self, done: f64, total: f64) -> ControlFlow<()> {
        (self.report)(done, total);
        if self.stop.load(Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}

/// Threads of the last call, with their process, since they do not survive a fork.
static THREADS: Mutex<Option<(u32, usize, Arc<ThreadPool>)>> = Mutex::new(None);

fn pool(threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    let count = threads.unwrap_or(0);
    let process = std::process::id();
    // Held together with the GIL, so that no fork in Python leaves it locked.
    let mut kept = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((of, size, pool)) = &*kept
        && (*of, *size) == (process, count)
    {
        return Ok(pool.clone());
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(count)
        .stack_size(STACK)
        .build()
        .map_err(|error| {
            InternalError::new_err(format!(
                "cannot start threads: {error}; threads=1 needs the least memory"
            ))
        })?;
    let pool = Arc::new(pool);
    if let Some((of, _, earlier)) = kept.replace((process, count, pool.clone()))
        && of != process
    {
        // Its threads exist only in the parent process and cannot be joined here.
        std::mem::forget(earlier);
    }
    Ok(pool)
}

/// Runs `work` on `threads` threads while other Python threads keep running; `progress` is called with done and total units.
///
/// Ctrl-C and exceptions in `progress` stop the work; if it cannot stop within half a second, it continues in the background and
/// its result is discarded.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> T + Send + 'static,
) -> PyResult<T> {
    let pool = pool(threads)?;
    let (sender, mut receiver) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    let watch = Watch {
        stop: stop.clone(),
        report: match progress {
            Some(_) => reporting(sender.clone()),
            None => Box::new(|_, _| ()),
        },
    };
    pool.spawn(move || {
        let ended = catch_unwind(AssertUnwindSafe(|| work(&watch)));
        // Nothing receives it if the call was interrupted.
        let _ = sender.send(Event::Ended(ended));
    });
    let interrupted = loop {
        let events = &mut receiver;
        let event = py.detach(move || events.recv_timeout(LOOK_EVERY));
        let seen = match event {
            Ok(Event::Ended(ended)) => return ended.map_err(|panic| defect(&*panic)),
            Ok(Event::Progress(done, total)) => {
                progress.map_or(Ok(()), |progress| progress.call1((done, total)).map(drop))
            }
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(InternalError::new_err(
                    "a computation ended without a result",
                ));
            }
        };
        if let Err(error) = seen.and_then(|()| py.check_signals()) {
            break error;
        }
    };
    stop.store(true, Ordering::Relaxed);
    py.detach(move || {
        let asked = Instant::now();
        while let Some(left) = PATIENCE.checked_sub(asked.elapsed()) {
            if let Ok(Event::Ended(_)) | Err(_) = receiver.recv_timeout(left) {
                break;
            }
        }
    });
    Err(interrupted)
}

fn reporting<T: Send + 'static>(sender: Sender<Event<T>>) -> Box<dyn Fn(f64, f64) + Send + Sync> {
    Box::new(move |done, total| {
        let _ = sender.send(Event::Progress(done, total));
    })
}

/// The exception for a panic.
fn defect(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    InternalError::new_err(format!("a computation failed: {text}"))
}
