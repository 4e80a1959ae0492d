//! How far a dataset has come, on stderr: as a bar, as lines, as JSON, or not at all.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use indicatif::{HumanDuration, ProgressBar};
use ppa_dataset::Progress;
use serde::Serialize;

use crate::output::{Output, bar};

/// Time between two lines, when progress is not a bar.
const TELL_EVERY: Duration = Duration::from_secs(10);

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Style {
    /// A bar with the time left
    Bar,
    /// A line of text every ten seconds
    Plain,
    /// A line of JSON every ten seconds: done, units, made, remaining_s
    Json,
    /// Nothing
    Quiet,
}

#[derive(Debug, Args)]
pub struct ProgressArgs {
    /// How progress is told on stderr [default: a bar in a terminal, else plain; json with --json]
    #[arg(long, value_enum, value_name = "HOW")]
    progress: Option<Style>,
}

impl ProgressArgs {
    /// Begins to tell.
    pub fn watch(&self, what: &'static str, output: Output) -> Watch {
        let style =
            self.progress
                .unwrap_or_else(|| match (output.json, std::io::stderr().is_terminal()) {
                    (true, _) => Style::Json,
                    (false, true) => Style::Bar,
                    (false, false) => Style::Plain,
                });
        Watch {
            style,
            what,
            bar: if style == Style::Bar {
                bar(what)
            } else {
                ProgressBar::hidden()
            },
            state: Mutex::new(State::new(Instant::now())),
        }
    }
}

/// Progress of one run.
pub struct Watch {
    style: Style,
    what: &'static str,
    bar: ProgressBar,
    state: Mutex<State>,
}

struct State {
    units: usize,
    found: usize,
    made: usize,
    started: Instant,
    told: Instant,
}

#[derive(Debug, Serialize)]
struct Line {
    done: usize,
    units: usize,
    made: usize,
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
            told: now,
        }
    }

    /// What is left at the rate of this run; what was found complete took no time.
    fn remaining(&self, now: Instant) -> Option<Duration> {
        let left = self.units.saturating_sub(self.found + self.made);
        let each = now.duration_since(self.started).as_secs_f64() / self.made as f64;
        Duration::try_from_secs_f64(each * left as f64).ok()
    }
}

impl Watch {
    /// Counts what a run reports.
    pub fn report(&self, progress: Progress) {
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        match progress {
            Progress::Total(units) => state.units = units,
            Progress::Found => state.found += 1,
            Progress::Made => state.made += 1,
        }
        let now = Instant::now();
        let remaining = state.remaining(now);
        let line = Line {
            done: state.found + state.made,
            units: state.units,
            made: state.made,
            remaining_s: remaining.map(|left| left.as_secs_f64().round()),
        };
        let left = remaining.map_or(String::new(), |left| {
            format!(", {} left", HumanDuration(left))
        });
        let due = now.duration_since(state.told) >= TELL_EVERY;
        if due {
            state.told = now;
        }
        match self.style {
            Style::Bar => {
                self.bar.set_length(line.units as u64);
                self.bar.set_position(line.done as u64);
                self.bar.set_message(format!("{}{left}", self.what));
            }
            Style::Plain if due => {
                eprintln!("{} of {} {}{left}", line.done, line.units, self.what);
            }
            Style::Json if due => {
                let line = serde_json::to_string(&line).expect("numbers are JSON values");
                eprintln!("{line}");
            }
            _ => {}
        }
    }

    /// Says how far a run came that was stopped and can go on.
    pub fn how_to_go_on(&self) -> String {
        let state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        format!(
            "after {} of {} {}; the same command goes on",
            state.found + state.made,
            state.units,
            self.what
        )
    }

    /// Ends the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
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
        let left = state.remaining(start + Duration::from_secs(20)).unwrap();
        assert_eq!(left, Duration::from_secs(80));
        assert_eq!(State::new(start).remaining(start), None);
    }
}
