//! What the benches of the crates measure in. Benches across crates live in the `benches` folder beside this file.

mod processor_time;

pub use processor_time::ProcessorTime;
