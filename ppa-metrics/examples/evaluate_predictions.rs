//! The metrics of one test set, and whether one method's errors over seeds are larger than another's.
//!
//! `cargo run -p ppa-metrics --example evaluate_predictions`

use std::error::Error;

use ppa_metrics::{evaluate, sign_flip_permutation};

fn main() -> Result<(), Box<dyn Error>> {
    let labels = [1.0, 1.0, 1.5, 2.0, 2.5, 3.0];
    let predictions = [1.1, 0.9, 1.8, 1.9, 2.6, 2.8];
    let report = evaluate(&labels, &predictions)?;
    println!(
        "MAE {:.3}, Spearman {:.3?}, diagnostic accuracy {:.2}",
        report.mae, report.spearman, report.diagnostic_accuracy
    );

    // MAE of five seeds, from scratch and with pretraining.
    let (scratch, pretrained) = (
        [0.31, 0.30, 0.35, 0.33, 0.29],
        [0.25, 0.26, 0.27, 0.30, 0.24],
    );
    let test = sign_flip_permutation(&scratch, &pretrained)?;
    println!(
        "p = {} that pretraining does not lower it",
        test.p_one_sided
    );
    Ok(())
}
