//! `ppa label agree`: agreement of readers.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::{count, number};
use ppa_label::read_grade_tables;
use ppa_metrics::agreement::{AgreementReport, PairReport, agreement_report};

use crate::output::Output;

#[derive(Debug, Args)]
#[command(after_help = "\
One row per grade: image, reader, grade (1 ideal to 3 inadequate, in half steps). A reader's second
grade of an image is a repeat: it measures how far the reader agrees with themselves, and counts nowhere
else. Intraclass correlations use the images that every reader graded; alpha uses all.

In what readers hand in, a picture that was shown twice has two names: `ppa label import` first, and take grades.csv.

  ppa label agree dataset/grades.csv --json")]
pub struct AgreeArgs {
    /// CSV files with the columns image, reader, grade
    #[arg(required = true)]
    csv: Vec<PathBuf>,
}

pub fn run(args: &AgreeArgs, output: Output) -> anyhow::Result<()> {
    let grades = read_grade_tables(&args.csv)?;
    output.print(&agreement_report(&grades)?, describe)
}

fn describe(report: &AgreementReport) -> String {
    let mut lines = vec![format!(
        "{}, {}",
        count(report.images, "image"),
        count(report.readers.len(), "reader")
    )];
    if let Some(icc) = &report.icc {
        lines.push(format!(
            "intraclass correlations of {} graded by all",
            count(icc.subjects, "image")
        ));
        for (name, form) in [
            ("ICC(1,1)", icc.one_way_single),
            ("ICC(A,1)", icc.agreement_single),
            ("ICC(C,1)", icc.consistency_single),
            ("ICC(1,k)", icc.one_way_mean),
            ("ICC(A,k)", icc.agreement_mean),
            ("ICC(C,k)", icc.consistency_mean),
        ] {
            lines.push(format!(
                "  {name}  {:.4}  95 % from {:.4} to {:.4}",
                number(form.value),
                number(form.low),
                number(form.high)
            ));
        }
    }
    for (name, alpha) in [
        ("ordinal", report.alpha_ordinal),
        ("interval", report.alpha_interval),
    ] {
        lines.extend(
            alpha.map(|alpha| format!("Krippendorff's alpha, {name}  {:.4}", number(alpha))),
        );
    }
    for PairReport {
        readers: [a, b],
        images,
        kappa_linear,
        kappa_quadratic,
    } in &report.pairs
    {
        let kappas = [("linear", kappa_linear), ("quadratic", kappa_quadratic)];
        let kappas: Vec<String> = kappas
            .iter()
            .filter_map(|(name, kappa)| kappa.map(|kappa| format!("{name} {:.4}", number(kappa))))
            .collect();
        lines.push(format!(
            "kappa of {a} and {b} ({})  {}",
            count(*images, "image"),
            kappas.join(", ")
        ));
    }
    for reader in &report.readers {
        let mut line = format!("{} ({})", reader.name, count(reader.images, "image"));
        if let Some(others) = &reader.against_others {
            line += &format!(
                "  bias {:+.3}, mean error {:.3} against the others",
                number(others.bias),
                others.mae
            );
        }
        if let Some(own) = &reader.against_self {
            line += &format!(
                "; {}: {:.0} % the same, mean error {:.3}",
                count(own.images, "repeat"),
                100.0 * own.equal,
                own.mae
            );
        }
        lines.push(line);
    }
    if !report.largest_disagreements.is_empty() {
        lines.push("largest disagreements".to_owned());
    }
    for found in &report.largest_disagreements {
        lines.push(format!(
            "  {}  {} to {}, std {:.3}",
            found.image, found.lowest, found.highest, found.std
        ));
    }
    lines.extend(
        report
            .undefined
            .iter()
            .map(|why| format!("not defined: {why}")),
    );
    lines.join("\n")
}
