//! Quality report: a dataset on one page, to be read before training on it.

mod chart;
mod curves;
mod cuts;
mod depth_view;
mod error;
mod figure;
mod findings;
mod histogram;
mod limb;
mod outliers;
mod page;
mod poses;
mod scale;
mod scene;
mod verdict;

pub use self::error::QaError;
pub use self::page::qa_page;
pub use self::poses::{PoseRow, pose_rows};
