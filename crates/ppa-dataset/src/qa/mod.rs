//! A dataset on one page, for a person to look through before anything is trained on it.

mod chart;
mod curves;
mod histogram;
mod outliers;
mod page;
mod scene;
mod views;

pub use self::page::{QaError, qa_page};
