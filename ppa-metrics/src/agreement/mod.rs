//! Agreement of readers: intraclass correlation, Krippendorff's α, weighted κ, bias of each reader, repeats;
//! [`agreement_report`] computes them all.

mod icc;
mod kappa;
mod krippendorff;
mod ratings;
mod readers;
mod report;

pub use icc::{Icc, IccForms, icc};
pub use kappa::{KappaWeights, weighted_kappa};
pub use krippendorff::{Measurement, krippendorff_alpha};
pub use ratings::Ratings;
pub use readers::{
    Disagreement, ReaderError, RepeatAgreement, disagreements, reader_errors, repeat_agreement,
};
pub use report::{
    AgreementReport, GradesByImage, ImageDisagreement, PairReport, ReaderReport, agreement_report,
};
