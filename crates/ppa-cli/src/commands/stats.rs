//! `ppa stats`: significance tests.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};
use ppa_metrics::sign_flip_permutation;
use serde::Deserialize;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum StatsCommand {
    /// Exact paired sign-flip permutation test of the mean difference a − b
    Permutation(PermutationArgs),
}

#[derive(Debug, Args)]
pub struct PermutationArgs {
    /// CSV with the columns a, b: one pair per row
    csv: PathBuf,
}

#[derive(Debug, Deserialize)]
struct Pair {
    a: f64,
    b: f64,
}

pub fn run(command: &StatsCommand, output: Output) -> anyhow::Result<()> {
    let StatsCommand::Permutation(args) = command;
    let pairs: Vec<Pair> = super::read_csv(&args.csv)?;
    let a: Vec<f64> = pairs.iter().map(|pair| pair.a).collect();
    let b: Vec<f64> = pairs.iter().map(|pair| pair.b).collect();
    let test = sign_flip_permutation(&a, &b).with_context(|| args.csv.display().to_string())?;
    output.print(&test, |test| {
        format!(
            "mean difference {:.6}, p one-sided {:.6}, p two-sided {:.6}, {} sign patterns",
            test.mean_difference, test.p_one_sided, test.p_two_sided, test.patterns
        )
    })
}
