//! Purposes of random numbers.

/// Streams of random numbers. Part of the reproducibility contract: append, never renumber.
#[repr(u32)]
pub(crate) enum Stream {
    History = 0,
    QuantumNoise = 1,
    Projection = 2,
    ElectronicNoise = 3,
    SingleScatter = 4,
    MultipleScatter = 5,
    MultipleScatterStarts = 6,
    SingleScatterSampling = 7,
    MultipleScatterSampling = 8,
    Gain = 9,
    Extrafocal = 10,
}
