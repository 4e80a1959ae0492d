#![doc = include_str!("../README.md")]

mod part;
pub mod random;
pub mod regular_file;
mod roi;
mod side;
mod source_hash;
pub mod text;
mod transform_rows;
mod view;
pub mod whole_file;

pub use part::{Part, PartError};
pub use roi::Roi;
pub use side::Side;
pub use source_hash::source_hash;
pub use transform_rows::{RigidError, TransformRows, check_rigid};
pub use view::View;
