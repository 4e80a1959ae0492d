//! Export for other programs: tables, metadata, archives. All of these are derived and can be regenerated.

mod bag;
mod croissant;
mod datasheet;
mod metadata;
mod ro_crate;
mod table;
#[cfg(feature = "parquet")]
mod table_parquet;
mod web_dataset;
mod write_metadata;

pub use self::bag::{Bag, BagError, bag};
pub use self::metadata::Metadata;
pub use self::table::{Column, Table, TableError, Values};
pub use self::web_dataset::{Shards, WebDatasetError, web_dataset};
pub use self::write_metadata::write_metadata;
