//! Numbers, counts and errors as text for people.
//!
//! ```
//! use ppa_core::text::{count, number, numbers};
//!
//! assert_eq!(format!("{:.3} mm", number(-0.0001)), "0.000 mm");
//! assert_eq!(count(1, "person"), "1 person");
//! assert_eq!(format!("{:.1} mm", numbers([1.0, -2.0, 0.25])), "1.0, -2.0, 0.2 mm");
//! ```

mod count;
mod error_chain;
mod number;

pub use count::{count, count_as};
pub use error_chain::error_chain;
pub use number::{Number, Numbers, number, numbers};
