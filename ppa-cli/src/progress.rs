//! Progress of a dataset on stderr: as a bar, as lines, as JSON, or not at all.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use indicatif::{HumanDuration, ProgressBar};
use ppa_core::text::count;
use ppa_generate::Progress;
use serde::Serialize;

use crate::output::{Output, bar};
use crate::stderr::warning;

/// Time between two lines if progress is not shown as a bar.
const INTERVAL: Duration = Duration::from_secs(10);

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Style {
    /// A bar with the time left
    Bar,
    /// A line of text every ten seconds
    Plain,
    /// A line of JSON every ten seconds: done, units, made, elapsed_s, remaining_s
    Json,
    /// Nothing
    Quiet,
}

#[derive(Debug, Args)]
pub struct ProgressArgs {
    /// How progress is shown on stderr [default: a bar in a terminal, else plain; json with --json]
    #[arg(long, value_enum, value_name = "HOW")]
    progress: Option<Style>,
}

impl ProgressArgs {
    /// Starts to show the progress; `what` is the name of the counted unit.
    pub fn watch(&self, what: &'static str, output: Output) -> Watch {
        let style =
            self.progress
                .unwrap_or_else(|| match (output.json, std::io::stderr().is_terminal()) {
                    (true, _) => Style::Json,
                    (false, true) => Style::Bar,
                    (false, false) => Style::Plain,
                });
        Watch::new(style, what, INTERVAL, |line| eprintln!("{line}"))
    }
}

/// Progress of one run. Lines are printed at fixed intervals, even while a single unit takes long.
pub struct Watch {
    what: &'static str,
    bar: ProgressBar,
    state: Arc<Mutex<State>>,
    ticker: Mutex<Option<Ticker>>,
    /// Findings that have already been repeated.
    repeated: Mutex<Vec<String>>,
}

struct State {
    units: usize,
    found: usize,
    made: usize,
    started: Instant,
}

#[derive(Debug, Serialize)]
struct Line {
    done: usize,
    units: usize,
    made: usize,
    elapsed_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    remaining_s: Option<f64>,
}

impl State {
    fn new(now: Instant) -> Self {
        Self {
            units: 0,
            found: 0,
            made: 0,
            started: now,
        }
    }

    /// Remaining time at the rate of this run; units that were already complete took no time.
    fn remaining(&self, now: Instant) -> Option<Duration> {
        let left = self.units.saturating_sub(self.found + self.made);
        let each = now.duration_since(self.started).as_secs_f64() / self.made as f64;
        Duration::try_from_secs_f64(each * left as f64).ok()
    }

    fn json(&self, now: Instant) -> String {
        let line = Line {
            done: self.found + self.made,
            units: self.units,
            made: self.made,
            elapsed_s: now.duration_since(self.started).as_secs_f64().round(),
            remaining_s: self.remaining(now).map(|left| left.as_secs_f64().round()),
        };
        serde_json::to_string(&line).expect("numbers are JSON values")
    }

    fn text(&self, what: &str, now: Instant) -> String {
        let elapsed = HumanDuration(now.duration_since(self.started));
        if self.units == 0 {
            return format!("{what}s are being counted, {elapsed} so far");
        }
        let time = match self.remaining(now) {
            Some(left) => format!("{} left", HumanDuration(left)),
            None => format!("{elapsed} so far"),
        };
        let done = self.found + self.made;
        format!("{done} of {}, {time}", count(self.units, what))
    }
}

fn locked(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(|e| e.into_inner())
}

impl Watch {
    fn new(
        style: Style,
        what: &'static str,
        interval: Duration,
        print: impl Fn(&str) + Send + 'static,
    ) -> Self {
        let state = Arc::new(Mutex::new(State::new(Instant::now())));
        let shown = Arc::clone(&state);
        let ticker = match style {
            Style::Bar | Style::Quiet => None,
            Style::Plain => Some(Ticker::start(interval, move || {
                print(&locked(&shown).text(what, Instant::now()));
            })),
            Style::Json => Some(Ticker::start(interval, move || {
                print(&locked(&shown).json(Instant::now()));
            })),
        };
        let bar = match style {
            Style::Bar => bar(&format!("{what}s")),
            _ => ProgressBar::hidden(),
        };
        if style == Style::Bar {
            bar.enable_steady_tick(Duration::from_secs(1));
        }
        Self {
            what,
            bar,
            state,
            ticker: Mutex::new(ticker),
            repeated: Mutex::default(),
        }
    }

    /// Processes a report of the run.
    pub fn report(&self, progress: Progress) {
        if let Progress::Findings(findings) = progress {
            let mut repeated = self.repeated.lock().unwrap_or_else(|e| e.into_inner());
            for line in findings.open_lines("") {
                if !repeated.contains(&line) {
                    self.bar.suspend(|| warning(&line));
                    repeated.push(line);
                }
            }
            return;
        }
        let mut state = locked(&self.state);
        match progress {
            Progress::Total(units) => state.units = units,
            Progress::Found => state.found += 1,
            Progress::Made => state.made += 1,
            Progress::Findings(_) => {}
        }
        let left = state.remaining(Instant::now());
        let left = left.map_or(String::new(), |left| {
            format!(", {} left", HumanDuration(left))
        });
        self.bar.set_length(state.units as u64);
        self.bar.set_position((state.found + state.made) as u64);
        self.bar.set_message(format!("{}s{left}", self.what));
    }

    /// Describes how far a stopped run came, and how to resume it.
    pub fn how_to_resume(&self) -> String {
        let state = locked(&self.state);
        format!(
            "after {} of {}; repeat the command to resume",
            state.found + state.made,
            count(state.units, self.what)
        )
    }

    /// Ends the bar or the lines.
    pub fn finish(&self) {
        let mut ticker = self.ticker.lock().unwrap_or_else(|e| e.into_inner());
        drop(ticker.take());
        self.bar.finish_and_clear();
    }
}

/// A thread that performs an action at fixed intervals until it is dropped.
struct Ticker {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Ticker {
    fn start(interval: Duration, mut tick: impl FnMut() + Send + 'static) -> Self {
        let (stop, stopped) = channel();
        let thread = std::thread::spawn(move || {
            while stopped.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                tick();
            }
        });
        Self {
            stop: Some(stop),
            thread: Some(thread),
        }
    }
}

impl Drop for Ticker {
    fn drop(&mut self) {
        drop(self.stop.take()); // the thread sees that the other end is gone
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_found_complete_does_not_make_the_rest_look_fast() {
        let start = Instant::now();
        let state = State {
            units: 100,
            found: 50,
            made: 10,
            ..State::new(start)
        };
        let now = start + Duration::from_secs(20);
        assert_eq!(state.remaining(now).unwrap(), Duration::from_secs(80));
        assert_eq!(state.text("pose", now), "60 of 100 poses, 80 seconds left");
        assert_eq!(State::new(start).remaining(start), None);
    }

    #[test]
    fn lines_come_while_nothing_is_reported() {
        let (send, lines) = channel();
        let interval = Duration::from_millis(20);
        let print = move |line: &str| send.send(line.to_owned()).unwrap();
        let watch = Watch::new(Style::Plain, "pose", interval, print);
        watch.report(Progress::Total(1));
        for _ in 0..3 {
            let line = lines.recv_timeout(Duration::from_secs(60)).unwrap();
            assert!(
                line.starts_with("0 of 1 pose, ") && line.ends_with(" so far"),
                "{line}"
            );
        }
        watch.finish();
        while lines.try_recv().is_ok() {}
        // The thread has ended, and with it the only sender.
        assert!(lines.recv().is_err());
    }

    #[test]
    fn lines_of_json_have_their_keys_before_anything_is_made() {
        let start = Instant::now();
        let line = State::new(start).json(start + Duration::from_secs(10));
        assert_eq!(line, r#"{"done":0,"units":0,"made":0,"elapsed_s":10.0}"#);
    }
}
