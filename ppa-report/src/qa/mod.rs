//! Quality report: a dataset on one page, to be read before anything is trained on it.

mod chart;
mod curves;
mod cuts;
mod findings;
mod histogram;
mod limb;
mod outliers;
mod page;
mod scale;
mod scene;
mod verdict;
mod views;

pub use self::page::{QaError, qa_page};
