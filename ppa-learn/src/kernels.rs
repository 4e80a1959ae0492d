//! Arithmetic on channels-last images: rows of pixels, with all f32 channels of a pixel next to each other. Inference also uses rows
//! of pixels with 16 channels each (`panel_rows`).
//!
//! Every kernel is vector code selected at run time; the scalar version gives the same results up to rounding.

pub(crate) mod batch_norm;
pub(crate) mod buffer;
pub(crate) mod depthwise;
pub(crate) mod depthwise_backward;
pub(crate) mod filter;
pub(crate) mod gradient;
pub(crate) mod matrix;
pub(crate) mod panel_rows;
pub(crate) mod panels;
pub(crate) mod pointwise;
pub(crate) mod simd;
pub(crate) mod stem;
