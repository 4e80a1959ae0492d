//! Results on stdout, as text or as one JSON object; progress on stderr.

use std::io::{self, Write};
use std::time::Instant;

use cpu_time::ProcessTime;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::stderr;

/// How results are printed.
#[derive(Debug, Clone, Copy)]
pub struct Output {
    /// One JSON object instead of text.
    pub json: bool,
}

impl Output {
    /// Prints a result: `value` as JSON or the text made by `text`.
    pub fn print<T: Serialize>(
        self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> anyhow::Result<()> {
        let line = if self.json {
            serde_json::to_string(value)?
        } else {
            text(value)
        };
        match writeln!(io::stdout(), "{line}") {
            // The reader has closed the pipe, as `head` does.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            result => Ok(result?),
        }
    }
}

/// Shows on stderr that a step which may take more than a second is running.
pub fn working(what: &str) -> ProgressBar {
    if stderr::is_json() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner:.cyan} {msg}");
    let spinner = ProgressBar::new_spinner()
        .with_style(style.expect("the template is a constant"))
        .with_message(what.to_owned());
    spinner.enable_steady_tick(std::time::Duration::from_millis(120));
    spinner
}

/// A progress bar on stderr with the remaining time.
pub fn bar(what: &str) -> ProgressBar {
    if stderr::is_json() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} [{bar:30.cyan}] {pos}/{len} {eta} left")
        .expect("the template is a constant");
    ProgressBar::new(0)
        .with_style(style)
        .with_message(what.to_owned())
}

/// Formats a number of bytes: `1.5 GB`.
pub fn bytes(bytes: u64) -> String {
    indicatif::DecimalBytes(bytes).to_string()
}

/// Parses bytes such as `800`, `1.5MB`, `20 GB`, `2TB`; units are powers of 1000.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let wrong = || format!("invalid size {text:?}; expected a number with kB, MB, GB or TB");
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err(wrong()),
    };
    let number: f64 = digits.trim_end().parse().map_err(|_| wrong())?;
    // f64 represents integers up to 2^53 exactly.
    let bytes = number * unit;
    ((1.0..=9e15).contains(&bytes))
        .then_some(bytes as u64)
        .ok_or_else(wrong)
}

/// Wall-clock and processor time of a step.
pub struct Stopwatch(Instant, ProcessTime);

/// Seconds since a [`Stopwatch`] was started.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Seconds {
    /// Wall clock.
    pub wall_s: f64,
    /// Processor, all threads.
    pub cpu_s: f64,
}

impl Stopwatch {
    /// Starts the stopwatch.
    pub fn start() -> Self {
        Self(Instant::now(), ProcessTime::now())
    }

    /// Seconds since the start.
    pub fn read(&self) -> Seconds {
        Seconds {
            wall_s: self.0.elapsed().as_secs_f64(),
            cpu_s: self.1.elapsed().as_secs_f64(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read() {
        assert_eq!(parse_bytes("800"), Ok(800));
        assert_eq!(parse_bytes("1.5MB"), Ok(1_500_000));
        assert_eq!(parse_bytes("20 GB"), Ok(20_000_000_000));
        for bad in [
            "", "GB", "-1MB", "nan", "inf GB", "0", "5 XB", "1e9TB", "5 Ω",
        ] {
            assert!(
                parse_bytes(bad).unwrap_err().contains("invalid size"),
                "{bad}"
            );
        }
    }
}
