//! Parameters prepared for inference.

use super::architecture::{Architecture, ConvKind, ConvPlace};
use super::norm::running;
use crate::kernels::batch_norm::Affine;
use crate::kernels::buffer::Pool;
use crate::kernels::depthwise::channels_last;
use crate::kernels::panels::Panels;

/// Every convolution of a backbone, with the normalisation after it where that can be folded in.
#[derive(Debug)]
pub struct Folded {
    pub blocks: Vec<FoldedBlock>,
    pub head: Panels,
}

/// The convolutions of a block.
#[derive(Debug)]
pub struct FoldedBlock {
    pub expand: Expansion,
    pub depthwise: Taps,
    pub project: Panels,
}

/// The first convolution of a block.
#[derive(Debug)]
pub enum Expansion {
    Stem(Taps),
    Pointwise(Panels),
}

/// A convolution of one channel for each of its own [kernel, kernel, channels], and the normalisation after it.
#[derive(Debug)]
pub struct Taps {
    pub weights: Vec<f32>,
    pub affine: Affine,
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
        let taps = |place: &ConvPlace| Taps {
            weights: channels_last(weight(place), place.channels),
            affine: affine(place),
        };
        let blocks = architecture.blocks.iter().map(|block| FoldedBlock {
            expand: match block.expand.kind {
                ConvKind::Pointwise => Expansion::Pointwise(panels(&block.expand)),
                ConvKind::Stem | ConvKind::Depthwise => Expansion::Stem(taps(&block.expand)),
            },
            depthwise: taps(&block.depthwise),
            project: panels(&block.project),
        });
        Self {
            blocks: blocks.collect(),
            head: panels(&architecture.head),
        }
    }
}
