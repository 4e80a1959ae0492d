//! Measurement shared by the benches of the crates. Benches across crates are in the `benches` folder next to this file.

mod processor_time;

pub use processor_time::ProcessorTime;
