//! A command whose histories are divided into tasks.

use std::fs;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use ppa_cluster::{DividedCommand, HistoryCost, HistoryWork, TaskSettings, Work, divide_histories};
use ppa_core::text::count;
use ppa_xray::{AnalogTally, TallyError};

use super::divisible_command::DivisibleCommand;
use crate::cluster_report::tallies;
use crate::commands::xray::Divisible;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::working;

/// A checked command that simulates histories.
pub struct HistoriesInput {
    /// Absolute path of its case or input file.
    pub input: PathBuf,
    arguments: DivisibleCommand,
    divided: DividedCommand,
}

impl HistoriesInput {
    /// Parses the words of a command line after `ppa`, and reads the files that they name.
    pub fn read(all_words: &[String], program_sha256: &str) -> anyhow::Result<Self> {
        let arguments = DivisibleCommand::parse(all_words)?;
        let (words, outputs) = without_outputs(all_words, arguments.output_options());
        let Divisible {
            input,
            histories,
            projections,
        } = arguments.divisible()?;
        Ok(Self {
            input: std::path::absolute(&input)
                .with_context(|| format!("cannot find {}", input.display()))?,
            divided: DividedCommand {
                command: arguments.kind(),
                words,
                outputs,
                folder: std::env::current_dir().context("cannot find the current folder")?,
                histories,
                projections,
                program_sha256: program_sha256.to_owned(),
            },
            arguments,
        })
    }

    /// Divides the histories into parts: as given, as known from a dry run, or by timing some histories now.
    pub fn divided(
        &self,
        tasks: Option<NonZeroU64>,
        known: Option<&Work>,
        settings: &TaskSettings,
    ) -> anyhow::Result<HistoryWork> {
        self.arguments.check_outputs()?;
        let known = known.and_then(|known| match known {
            Work::Histories(work) if self.is_same_command(work) => Some((work.parts, work.cost)),
            _ => None,
        });
        let (parts, cost) = match (tasks, known) {
            (Some(tasks), _) => (tasks.get(), None),
            (None, Some((parts, None))) => (parts, None),
            (None, known) => {
                let cost = match known.and_then(|(_, cost)| cost) {
                    Some(cost) => cost,
                    None => self.measured()?,
                };
                let all = self.divided.all_histories();
                let parts = divide_histories(all, cost, settings.cpus, settings.time)?;
                (parts.min(self.divided.histories), Some(cost))
            }
        };
        ensure!(
            parts <= self.divided.histories,
            "{parts} tasks are more than {} histories",
            self.divided.histories
        );
        Ok(HistoryWork {
            divided: self.divided.clone(),
            parts,
            cost,
        })
    }

    fn measured(&self) -> anyhow::Result<HistoryCost> {
        let _stoppable = ends_at_once(NOTHING_WRITTEN)?;
        let working = working("measuring histories");
        let cost = self.arguments.cost()?;
        working.finish_and_clear();
        Ok(cost)
    }

    /// Refuses a command other than the submitted one, and changes that would make parts incompatible.
    pub fn check_same(
        &self,
        submitted: &HistoryWork,
        tasks: Option<NonZeroU64>,
        settings: &TaskSettings,
    ) -> anyhow::Result<()> {
        let before = &submitted.divided;
        ensure!(
            self.is_same_command(submitted),
            "the command differs from the one that was submitted, ppa {} {}: choose another --out",
            before.words.join(" "),
            before.outputs.join(" ")
        );
        ensure!(
            self.divided.folder == before.folder,
            "the command was submitted from {}, where its paths start: repeat it there, or choose another --out",
            before.folder.display()
        );
        ensure!(
            self.divided.program_sha256 == before.program_sha256,
            "ppa is not the program that was submitted, and tallies of two programs do not fit together: choose another --out"
        );
        ensure!(
            tasks.is_none_or(|tasks| tasks.get() == submitted.parts),
            "the histories are divided into {} already, which --tasks cannot change; choose another --out",
            count(submitted.parts, "part")
        );
        if let Some(cost) = submitted.cost {
            let all = before.all_histories();
            divide_histories(all, cost, settings.cpus, settings.time)?;
        }
        Ok(())
    }

    /// Whether the words and the work they describe are the same; folder and program may differ.
    fn is_same_command(&self, other: &HistoryWork) -> bool {
        let (own, other) = (&self.divided, &other.divided);
        (&own.words, &own.outputs) == (&other.words, &other.outputs)
            && (own.histories, own.projections) == (other.histories, other.projections)
    }
}

/// Describes the first damaged tally of a part; with `rename`, damaged tallies are renamed, since their task would resume them.
pub fn damaged_tally(part: &Path, rename: bool) -> anyhow::Result<Option<String>> {
    let mut first = None;
    for tally in tallies(part) {
        let error = match AnalogTally::read(&tally) {
            Ok(_) => continue,
            Err(
                error @ (TallyError::Damaged { .. }
                | TallyError::Size { .. }
                | TallyError::Foreign { .. }),
            ) => error,
            Err(error) => return Err(error.into()),
        };
        if rename {
            let mut names = (1..).map(|n| tally.with_extension(format!("tally.damaged{n}")));
            let free = names.find(|name| !name.exists()).expect("a free name");
            fs::rename(&tally, &free)
                .with_context(|| format!("cannot rename {}", tally.display()))?;
        }
        first.get_or_insert(error.to_string());
    }
    Ok(first)
}

/// Splits a command line into words that do not name outputs and words that do; `options` have a value, flags do not.
fn without_outputs(
    words: &[String],
    (options, flags): (&[&str], &[&str]),
) -> (Vec<String>, Vec<String>) {
    let (mut others, mut outputs) = (Vec::new(), Vec::new());
    let mut words = words.iter();
    while let Some(word) = words.next() {
        let name = word.split_once('=').map_or(&**word, |(name, _)| name);
        let is_option = options.contains(&name);
        match is_option || flags.contains(&&**word) {
            true => outputs.push(word.clone()),
            false => others.push(word.clone()),
        }
        if is_option && name == word {
            outputs.extend(words.next().cloned());
        }
    }
    (others, outputs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_found_with_and_without_equals_sign() {
        let words =
            |text: &str| -> Vec<String> { text.split_whitespace().map(str::to_owned).collect() };
        let (others, outputs) = without_outputs(
            &words("xray simulate --out a.png leg.toml --exr=a.exr --replace --angle -3"),
            (&["--out", "--exr"], &["--replace"]),
        );
        assert_eq!(others, words("xray simulate leg.toml --angle -3"));
        assert_eq!(outputs, words("--out a.png --exr=a.exr --replace"));
    }
}
