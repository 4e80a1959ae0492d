//! Random numbers addressed by (seed, purpose, index): whoever draws the number at an address, whenever and on whatever thread,
//! gets the same one.
//!
//! What a number is for, the purpose, is an enumeration of the crate that draws it.

mod philox;
mod seed;
mod split_mix;

pub use philox::{Philox, philox};
pub use seed::seed_of_address;
pub use split_mix::{split_mix, split_mix_at};
