//! Ctrl-C and TERM end a command after its current step. A second signal ends it at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use ppa_dataset::Stopped;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::interrupted::{BY_SIGNAL, Interrupted};
use crate::stderr;

const SIGNALS: [i32; 2] = [SIGINT, SIGTERM];

/// Longest time until a signal is noticed.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Whether Ctrl-C was pressed or TERM was sent since [`Interrupt::listen`].
#[derive(Debug)]
pub struct Interrupt {
    asked: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Interrupt {
    /// Starts to listen.
    pub fn listen() -> anyhow::Result<Self> {
        let asked = Arc::new(AtomicBool::new(false));
        let signal = Arc::new(AtomicUsize::new(0));
        for number in SIGNALS {
            // In this order: the first signal finds the flag unset and sets it, the second finds it set.
            flag::register_conditional_shutdown(number, BY_SIGNAL + number, Arc::clone(&asked))
                .and_then(|_| flag::register_usize(number, Arc::clone(&signal), number as usize))
                .and_then(|_| flag::register(number, Arc::clone(&asked)))
                .context("cannot listen for Ctrl-C")?;
        }
        Ok(Self { asked, signal })
    }

    /// True once the command should stop.
    pub fn flag(&self) -> &AtomicBool {
        &self.asked
    }

    /// Whether the command should stop.
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// The error of a stopped command; `how` says what is kept and how to resume.
    pub fn stopped(&self, how: impl Into<String>) -> anyhow::Error {
        Interrupted {
            signal: self.signal.load(Ordering::Relaxed) as i32,
            how: how.into(),
        }
        .into()
    }

    /// Adds how to resume to the error of a library that stopped on request.
    pub fn or_how<T, E>(
        &self,
        result: Result<T, E>,
        how: impl FnOnce() -> String,
    ) -> anyhow::Result<T>
    where
        E: Into<anyhow::Error>,
    {
        result.map_err(|error| {
            let error = error.into();
            match error.chain().any(|cause| cause.is::<Stopped>()) {
                true => self.stopped(how()),
                false => error,
            }
        })
    }
}

/// Message of a command that wrote nothing.
pub const NOTHING_WRITTEN: &str = "before anything was written; repeat the command to start over";

/// While this value exists, Ctrl-C and TERM end the program at once, with a line that says how to resume.
#[derive(Debug)]
pub struct EndsAtOnce(Arc<AtomicBool>);

/// For work that writes nothing before its end. Drop the result before writing anything.
pub fn ends_at_once(how: &'static str) -> anyhow::Result<EndsAtOnce> {
    let interrupt = Interrupt::listen()?;
    let over = Arc::new(AtomicBool::new(false));
    let ends = EndsAtOnce(Arc::clone(&over));
    thread::spawn(move || {
        while !over.load(Ordering::Relaxed) {
            if interrupt.is_asked() {
                let exit_code = stderr::failure(&interrupt.stopped(how));
                std::process::exit(exit_code.into());
            }
            thread::sleep(LOOK_EVERY);
        }
    });
    Ok(ends)
}

impl Drop for EndsAtOnce {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
