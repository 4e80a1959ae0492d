//! Why a scan could not be read or written.

mod read;
mod write;

pub use read::{Gap, ReadError};
pub use write::WriteError;

/// An error of a file-format library, kept as the source of ours.
type Cause = Box<dyn std::error::Error + Send + Sync>;
