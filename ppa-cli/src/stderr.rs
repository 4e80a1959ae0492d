//! Messages on stderr other than progress: warnings, notes, and the final error.
//!
//! With `--json` each is one line of JSON.

use std::ffi::OsStr;
use std::sync::OnceLock;

use anstream::AutoStream;
use clap::ColorChoice;
use clap::builder::styling::{AnsiColor, Style};
use clap::error::ErrorKind;
use serde::Serialize;
use serde_json::json;

use crate::interrupted::Interrupted;

/// Exit code of a failed command; clap uses 2.
const FAILED: u8 = 1;

static AS_JSON: OnceLock<bool> = OnceLock::new();

/// Global options needed before the command line is parsed, since parsing may fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GlobalOptions {
    /// Whether `--json` was given.
    pub json: bool,
    /// Value of the last `--color`; `Auto` if there is none.
    pub color: ColorChoice,
}

impl GlobalOptions {
    /// Finds both options among the arguments before `--`.
    pub fn of<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Self {
        let mut options = Self {
            json: false,
            color: ColorChoice::Auto,
        };
        let mut arguments = arguments.into_iter();
        while let Some(argument) = arguments.next() {
            let value = match argument.as_ref().to_str() {
                Some("--") => break,
                Some("--json") => {
                    options.json = true;
                    continue;
                }
                Some("--color") => arguments.next().map(|value| value.as_ref().to_owned()),
                Some(text) => text.strip_prefix("--color=").map(Into::into),
                None => None,
            };
            let choice = value
                .as_ref()
                .and_then(|value| value.to_str()?.parse().ok());
            options.color = choice.unwrap_or(options.color);
        }
        options
    }
}

/// Sets the colours of all output, and whether stderr gets lines of JSON. To be called once, before any output.
pub fn set_up(json: bool, color: ColorChoice) {
    let choice = match color {
        ColorChoice::Auto => anstream::ColorChoice::Auto,
        ColorChoice::Always => anstream::ColorChoice::Always,
        ColorChoice::Never => anstream::ColorChoice::Never,
    };
    choice.write_global();
    let resolved = AutoStream::choice(&std::io::stderr());
    console::set_colors_enabled_stderr(resolved != anstream::ColorChoice::Never);
    AS_JSON.get_or_init(|| json);
}

/// Whether stderr gets lines of JSON.
pub fn is_json() -> bool {
    AS_JSON.get().copied().unwrap_or(false)
}

/// Prints a warning about something that may make a result wrong or incomplete.
pub fn warning(text: &str) {
    say("warning", AnsiColor::Yellow.on_default().bold(), text);
}

/// Prints a note.
pub fn note(text: &str) {
    say("note", Style::new(), text);
}

fn say(kind: &str, style: Style, text: &str) {
    match (is_json(), kind) {
        (true, _) => anstream::eprintln!("{}", json!({ kind: text })),
        (false, "note") => anstream::eprintln!("{text}"),
        (false, _) => anstream::eprintln!("{style}{kind}:{style:#} {text}"),
    }
}

/// The final error in the form that `--json` prints.
#[derive(Debug, PartialEq, Serialize)]
struct Failure {
    error: String,
    causes: Vec<String>,
    exit_code: u8,
}

/// Prints why a command failed or was stopped, and returns the exit code.
pub fn failure(error: &anyhow::Error) -> u8 {
    let stopped = error.downcast_ref::<Interrupted>();
    let exit_code = stopped.map_or(FAILED, Interrupted::exit_code);
    if is_json() {
        let causes = error.chain().skip(1).map(ToString::to_string);
        end(&Failure {
            error: error.to_string(),
            causes: causes.collect(),
            exit_code,
        });
    } else {
        let style = AnsiColor::Red.on_default().bold();
        anstream::eprintln!("{style}ppa:{style:#} {error:#}");
    }
    exit_code
}

/// Prints why the command line is invalid, or the help or version it asks for, and returns the exit code.
pub fn usage(error: &clap::Error) -> u8 {
    let exit_code = u8::try_from(error.exit_code()).unwrap_or(FAILED);
    if is_json() && error.use_stderr() {
        end(&Failure {
            error: in_one_line(error),
            causes: Vec::new(),
            exit_code,
        });
    } else {
        // The reader may have closed the pipe, as after `ppa --help | head`.
        let _ = error.print();
    }
    exit_code
}

fn end(failure: &Failure) {
    let line = serde_json::to_string(failure).expect("text and numbers are JSON");
    anstream::eprintln!("{line}");
}

/// clap's message without its usage: lines joined by spaces, tips after semicolons.
pub fn in_one_line(error: &clap::Error) -> String {
    if let ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand | ErrorKind::MissingSubcommand =
        error.kind()
    {
        return "a command is missing; --help lists them".to_owned();
    }
    let text = error.render().to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let paragraphs = text.split("\n\n").take_while(|paragraph| {
        !paragraph.starts_with("Usage:") && !paragraph.starts_with("For more information")
    });
    let words = |paragraph: &str| paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
    paragraphs.map(words).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_and_color_are_found_before_parsing() {
        let of = |text: &str| GlobalOptions::of(text.split(' '));
        let plain = GlobalOptions {
            json: false,
            color: ColorChoice::Auto,
        };
        assert_eq!(of("ppa ct info a -- --json --color=always"), plain);
        assert_eq!(of("ppa --color sideways status"), plain);
        let both = GlobalOptions {
            json: true,
            color: ColorChoice::Never,
        };
        assert_eq!(of("ppa --color always status --json --color=never"), both);
    }

    #[test]
    fn usage_errors_are_one_line_without_the_usage() {
        let error = |text: &str| {
            let parsed = crate::help::command().try_get_matches_from(text.split(' '));
            in_one_line(&parsed.unwrap_err())
        };
        assert_eq!(
            error("ppa qa data --outt x"),
            "unexpected argument '--outt' found; tip: a similar argument exists: '--out'"
        );
        assert_eq!(
            error("ppa ct convert"),
            "the following required arguments were not provided: <CT> <OUTPUT>"
        );
        assert_eq!(error("ppa"), "a command is missing; --help lists them");
    }
}
