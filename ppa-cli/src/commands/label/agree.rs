//! `ppa label agree`: agreement of readers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use ppa_core::text::{count, number};
use ppa_metrics::agreement::{
    IccForms, KappaWeights, Measurement, Ratings, ReaderError, RepeatAgreement, disagreements, icc,
    krippendorff_alpha, reader_errors, repeat_agreement, weighted_kappa,
};
use serde::{Deserialize, Serialize};

use crate::output::Output;

/// How many of the images on which readers differ most are shown.
const SHOWN: usize = 10;

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

#[derive(Debug, Deserialize)]
struct Row {
    image: String,
    reader: String,
    grade: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    images: usize,
    readers: Vec<Reader>,
    #[serde(skip_serializing_if = "Option::is_none")]
    icc: Option<IccForms>,
    #[serde(skip_serializing_if = "Option::is_none")]
    alpha_ordinal: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    alpha_interval: Option<f64>,
    pairs: Vec<Pair>,
    largest_disagreements: Vec<Disagreement>,
    /// What has no value, and why.
    undefined: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Reader {
    name: String,
    images: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    against_others: Option<ReaderError>,
    #[serde(skip_serializing_if = "Option::is_none")]
    against_self: Option<RepeatAgreement>,
}

#[derive(Debug, Serialize)]
struct Pair {
    readers: [String; 2],
    images: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    kappa_linear: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    kappa_quadratic: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Disagreement {
    image: String,
    lowest: f64,
    highest: f64,
    std: f64,
}

/// First grade, and the second where there is one.
type Grades = (f64, Option<f64>);

pub fn run(args: &AgreeArgs, output: Output) -> anyhow::Result<()> {
    let mut by_image: BTreeMap<String, BTreeMap<String, Grades>> = BTreeMap::new();
    for path in &args.csv {
        for row in super::super::read_csv::<Row>(path)? {
            check(&row).with_context(|| path.display().to_string())?;
            add(&mut by_image, row, path)?;
        }
    }
    output.print(&report(&by_image)?, describe)
}

fn check(row: &Row) -> anyhow::Result<()> {
    let on_scale = (1.0..=3.0).contains(&row.grade) && (2.0 * row.grade).fract() == 0.0;
    ensure!(
        on_scale,
        "{} grades {} with {}, expected 1, 1.5, 2, 2.5 or 3",
        row.reader,
        row.image,
        row.grade
    );
    ensure!(
        !ppa_dataset::is_formula(&row.reader),
        "a reader is called {:?}, which spreadsheets take for a formula",
        row.reader
    );
    Ok(())
}

fn add(
    by_image: &mut BTreeMap<String, BTreeMap<String, Grades>>,
    row: Row,
    path: &Path,
) -> anyhow::Result<()> {
    let of_image = by_image.entry(row.image.clone()).or_default();
    let Some(grades) = of_image.get_mut(&row.reader) else {
        of_image.insert(row.reader, (row.grade, None));
        return Ok(());
    };
    ensure!(
        grades.1.is_none(),
        "{}: {} grades {} a third time, expected once or twice",
        path.display(),
        row.reader,
        row.image
    );
    grades.1 = Some(row.grade);
    Ok(())
}

fn report(by_image: &BTreeMap<String, BTreeMap<String, Grades>>) -> anyhow::Result<Report> {
    let mut names: Vec<&String> = by_image.values().flat_map(BTreeMap::keys).collect();
    names.sort_unstable();
    names.dedup();
    let row = |of_image: &BTreeMap<String, Grades>| {
        let grade = |name: &&String| of_image.get(*name).map(|grades| grades.0);
        names.iter().map(grade).collect()
    };
    let ratings = Ratings::new(by_image.values().map(row).collect())?;
    let mut undefined = Vec::new();
    let mut or_reason = |what: String, value: Result<f64, ppa_metrics::MetricError>| {
        value
            .map_err(|error| undefined.push(format!("{what}: {error}")))
            .ok()
    };
    let mut alpha = |name: &str, measurement| {
        or_reason(name.to_owned(), krippendorff_alpha(&ratings, measurement))
    };
    let alpha_ordinal = alpha("alpha, ordinal", Measurement::Ordinal);
    let alpha_interval = alpha("alpha, interval", Measurement::Interval);
    let mut pairs = Vec::new();
    for first in 0..names.len() {
        for second in first + 1..names.len() {
            let (a, b) = ratings.common(first, second);
            let readers = [names[first].clone(), names[second].clone()];
            let mut kappa = |name: &str, weights| {
                let what = format!("{name} kappa of {} and {}", readers[0], readers[1]);
                or_reason(what, weighted_kappa(&a, &b, weights))
            };
            pairs.push(Pair {
                images: a.len(),
                kappa_linear: kappa("linear", KappaWeights::Linear),
                kappa_quadratic: kappa("quadratic", KappaWeights::Quadratic),
                readers,
            });
        }
    }
    let icc = icc(&ratings)
        .map_err(|error| undefined.push(format!("intraclass correlation: {error}")))
        .ok();
    let readers = names.iter().zip(reader_errors(&ratings));
    let images: Vec<&String> = by_image.keys().collect();
    Ok(Report {
        images: by_image.len(),
        readers: readers
            .map(|(name, against_others)| Reader {
                images: by_image
                    .values()
                    .filter(|of| of.contains_key(*name))
                    .count(),
                against_self: repeats(by_image, name),
                name: (*name).clone(),
                against_others,
            })
            .collect(),
        icc,
        alpha_ordinal,
        alpha_interval,
        pairs,
        largest_disagreements: disagreements(&ratings)
            .into_iter()
            .take(SHOWN)
            .map(|found| Disagreement {
                image: images[found.subject].clone(),
                lowest: found.lowest,
                highest: found.highest,
                std: found.std,
            })
            .collect(),
        undefined,
    })
}

fn repeats(
    by_image: &BTreeMap<String, BTreeMap<String, Grades>>,
    reader: &str,
) -> Option<RepeatAgreement> {
    let twice = |of_image: &BTreeMap<String, Grades>| {
        let (first, second) = of_image.get(reader)?;
        second.map(|second| (*first, second))
    };
    let (first, second): (Vec<f64>, Vec<f64>) = by_image.values().filter_map(twice).unzip();
    repeat_agreement(&first, &second).ok()
}

fn describe(report: &Report) -> String {
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
    for Pair {
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
