//! `ppa --help`: the commands in groups.

use std::fmt::Write;

use clap::{Command, CommandFactory};

use crate::Cli;

/// Headings of `ppa --help`, and the commands below each of them.
const GROUPS: &[(&str, &[&str])] = &[
    ("Start here", &["demo", "studio"]),
    ("Scan and case", &["ct", "prepare", "case", "mesh"]),
    ("Scene, depth and radiograph", &["scene", "depth", "xray"]),
    (
        "Dataset",
        &[
            "plan", "generate", "submit", "status", "cancel", "merge", "verify", "dataset", "qa",
            "export",
        ],
    ),
    ("Labels", &["label"]),
    (
        "Networks",
        &[
            "train",
            "eval",
            "calibrate",
            "predict",
            "experiment",
            "learn",
        ],
    ),
    ("Statistics", &["metrics", "stats"]),
    ("Program", &["completions", "man", "help"]),
];

/// The command line. clap has no headings for subcommands, so the list is part of the help template.
pub fn command() -> Command {
    let command = Cli::command();
    let template = template(&command);
    command.help_template(template)
}

fn template(command: &Command) -> String {
    let styles = command.get_styles();
    let (header, literal) = (styles.get_header(), styles.get_literal());
    let mut built = command.clone();
    built.build(); // adds the command `help`
    let names = GROUPS.iter().flat_map(|(_, names)| *names);
    let width = names.map(|name| name.len()).max().unwrap_or(0);
    let mut text = "{before-help}{about-with-newline}\n{usage-heading} {usage}\n\n".to_owned();
    for (heading, names) in GROUPS {
        let _ = writeln!(text, "{header}{heading}:{header:#}");
        for name in *names {
            // Absent if its feature is off.
            let Some(subcommand) = built.find_subcommand(name) else {
                continue;
            };
            let about = subcommand.get_about();
            let about = about.map_or(String::new(), ToString::to_string);
            let _ = writeln!(text, "  {literal}{name:<width$}{literal:#}  {about}");
        }
        text.push('\n');
    }
    let _ = write!(
        text,
        "{header}Options:{header:#}\n{{options}}{{after-help}}"
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_stands_once_in_the_help_with_its_about() {
        let mut built = Cli::command();
        built.build();
        let help = command().render_help().to_string();
        for subcommand in built.get_subcommands() {
            let (name, about) = (
                subcommand.get_name(),
                subcommand.get_about().unwrap().to_string(),
            );
            let grouped = GROUPS.iter().flat_map(|(_, names)| *names);
            assert_eq!(
                grouped.filter(|one| **one == name).count(),
                1,
                "{name} in GROUPS"
            );
            let lines = help.lines();
            let lines: Vec<_> = lines
                .filter(|line| line.split_whitespace().next() == Some(name))
                .collect();
            assert_eq!(lines.len(), 1, "{name}: {lines:?}");
            assert_eq!(lines[0].trim_start()[name.len()..].trim(), about);
        }
        for name in GROUPS.iter().flat_map(|(_, names)| *names) {
            assert!(
                built.find_subcommand(name).is_some(),
                "there is no command {name}"
            );
        }
    }

    #[test]
    fn the_listing_fits_into_eighty_columns() {
        let help = command().term_width(80).render_help().to_string();
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }

    #[test]
    fn examples_fit_into_eighty_columns() {
        fn check(command: &clap::Command) {
            let text = command.get_after_long_help().map(ToString::to_string);
            // Other lines are paragraphs, which clap wraps. A wrapped example can no longer be copied.
            let text = text.unwrap_or_default();
            let examples = text.lines().filter(|line| line.starts_with("  "));
            for line in examples {
                assert!(line.chars().count() <= 80, "{}: {line}", command.get_name());
            }
            command.get_subcommands().for_each(check);
        }
        check(&command());
    }

    #[test]
    fn the_definition_of_the_command_line_is_consistent() {
        command().debug_assert();
    }
}
