#![doc = include_str!("../README.md")]

mod part;
pub mod random;
pub mod regular_file;
mod roi;
mod side;
pub mod text;
mod transform_rows;
mod view;
pub mod whole_file;

pub use part::{Part, PartError};
pub use roi::Roi;
pub use side::Side;
pub use transform_rows::TransformRows;
pub use view::View;
