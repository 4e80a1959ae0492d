//! Parameters prepared for inference.

use super::architecture::{Architecture, ConvPlace};
use super::norm::running;
use crate::kernels::buffer::Pool;
use crate::kernels::filter::Taps;
use crate::kernels::panels::Panels;

/// All convolutions of a backbone, with the normalisations after them folded in.
#[derive(Debug)]
pub struct Folded {
    pub blocks: Vec<FoldedBlock>,
    pub head: Panels,
}

/// The convolutions of a block.
#[derive(Debug)]
pub struct FoldedBlock {
    /// The stem as a pointwise convolution of each pixel's neighbours.
    pub expand: Panels,
    pub depthwise: Taps,
    pub project: Panels,
}

impl Folded {
    pub fn new(
        architecture: &Architecture,
        parameters: &[f32],
        statistics: &[f32],
        pool: &Pool,
    ) -> Self {
        let affine = |place: &ConvPlace| running(&place.norm, parameters, statistics);
        let weight = |place: &ConvPlace| &parameters[place.weight.clone()];
        let panels = |place: &ConvPlace| Panels::new(weight(place), &affine(place), pool);
        let taps = |place: &ConvPlace| Taps::new(place.window, weight(place), &affine(place), pool);
        let blocks = architecture.blocks.iter().map(|block| FoldedBlock {
            expand: panels(&block.expand),
            depthwise: taps(&block.depthwise),
            project: panels(&block.project),
        });
        Self {
            blocks: blocks.collect(),
            head: panels(&architecture.head),
        }
    }
}
