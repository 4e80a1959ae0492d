//! `ppa stats`: significance tests.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};
use ppa_core::text::{count, number};
use ppa_metrics::{mean_per_seed, sign_flip_permutation};
use serde::Deserialize;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum StatsCommand {
    /// Exact paired sign-flip test of the mean difference a − b
    Permutation(PermutationArgs),
}

#[derive(Debug, Args)]
pub struct PermutationArgs {
    /// CSV with the columns a, b: one pair per row; with a column seed, the rows of a seed (its folds) are averaged first
    csv: PathBuf,
}

#[derive(Debug, Deserialize)]
struct Pair {
    seed: Option<u64>,
    a: f64,
    b: f64,
}

pub fn run(command: &StatsCommand, output: Output) -> anyhow::Result<()> {
    let StatsCommand::Permutation(args) = command;
    let pairs: Vec<Pair> = super::read_csv(&args.csv)?;
    let (mut a, mut b): (Vec<_>, Vec<_>) = pairs.iter().map(|pair| (pair.a, pair.b)).unzip();
    let file = || args.csv.display().to_string();
    let seeds: Vec<_> = pairs.iter().filter_map(|pair| pair.seed).collect();
    if !seeds.is_empty() {
        (a, b) = mean_per_seed(&seeds, &a, &b).with_context(file)?;
    }
    let test = sign_flip_permutation(&a, &b).with_context(file)?;
    output.print(&test, |test| {
        format!(
            "mean difference {:.6}, p one-sided {}, p two-sided {}, {}",
            number(test.mean_difference),
            probability(test.p_one_sided),
            probability(test.p_two_sided),
            count(test.patterns, "sign pattern")
        )
    })
}

/// Formats a probability of an exact test, which is never 0.
fn probability(p: f64) -> String {
    if p < 1e-6 {
        format!("{p:.1e}")
    } else {
        format!("{p:.6}")
    }
}
