//! Random numbers addressed by (seed, purpose, index): the number at an address is the same no matter when, where and on which thread it is drawn.
//!
//! Each crate that draws numbers lists their purposes in an enumeration.

mod philox;
mod seed;
mod split_mix;

pub use philox::{Philox, philox};
pub use seed::seed_of_address;
pub use split_mix::{split_mix, split_mix_at};
