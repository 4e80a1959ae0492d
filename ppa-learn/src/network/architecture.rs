//! The blocks of EfficientNet-B0, and the position of each parameter in the flat variables.

use std::ops::Range;

use candle_core::Tensor;

use super::{Named, NetworkError};
use crate::kernels::depthwise::Window;

/// Number of features, the inputs of the last layer.
pub const FEATURES: usize = 1280;
/// Channels of the first convolution.
const STEM: usize = 32;

/// Expansion, kernel, stride, channels out and blocks of a stage.
pub(super) type Stage = (usize, usize, usize, usize, usize);

/// The seven stages: table 1 of Tan and Le 2019.
const STAGES: [Stage; 7] = [
    (1, 3, 1, 16, 1),
    (6, 3, 2, 24, 2),
    (6, 5, 2, 40, 2),
    (6, 3, 2, 80, 3),
    (6, 5, 1, 112, 3),
    (6, 5, 2, 192, 4),
    (6, 3, 1, 320, 1),
];

/// A named part of a flat variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// torchvision's name.
    pub name: String,
    /// torchvision's shape.
    pub shape: Vec<usize>,
    /// Its range in the variable.
    pub range: Range<usize>,
}

impl Entry {
    /// Returns this part of a flat tensor in its shape, with gradients.
    pub(super) fn view(&self, flat: &Tensor) -> candle_core::Result<Tensor> {
        flat.narrow(0, self.range.start, self.range.len())?
            .reshape(&self.shape[..])
    }

    pub(super) fn of(&self, flat: &Tensor) -> Result<Named, NetworkError> {
        let part = flat
            .detach()
            .narrow(0, self.range.start, self.range.len())?;
        Ok(Named {
            name: self.name.clone(),
            // `copy` would clone all of `flat` for each of its parts.
            tensor: part.reshape(&self.shape[..])?.force_contiguous()?,
        })
    }
}

/// Parameters and running statistics of a normalisation; the length of all four ranges is its number of channels.
#[derive(Debug, Clone)]
pub struct NormPlace {
    pub weight: Range<usize>,
    pub bias: Range<usize>,
    pub mean: Range<usize>,
    pub variance: Range<usize>,
}

/// Inputs of each output channel of a convolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConvKind {
    /// The only channel of the images.
    Stem,
    /// All channels, one pixel of each.
    Pointwise,
    /// The same channel.
    Depthwise,
}

/// A convolution without bias, and the normalisation after it.
#[derive(Debug, Clone)]
pub struct ConvPlace {
    pub kind: ConvKind,
    pub window: Window,
    pub weight: Range<usize>,
    pub norm: NormPlace,
    pub channels: usize,
    /// Number of input channels of each output channel.
    pub inputs: usize,
}

/// A fully connected layer.
#[derive(Debug, Clone)]
pub struct LinearPlace {
    pub weight: Range<usize>,
    pub bias: Range<usize>,
}

/// The two layers of a squeeze-and-excitation.
#[derive(Debug, Clone)]
pub struct SqueezePlace {
    pub squeeze: LinearPlace,
    pub expand: LinearPlace,
}

/// One inverted residual block. The expansion of the first block is the network's first convolution.
#[derive(Debug, Clone)]
pub struct Block {
    /// Number of the block, from 0.
    pub number: usize,
    pub expand: ConvPlace,
    pub depthwise: ConvPlace,
    pub squeeze: SqueezePlace,
    pub project: ConvPlace,
    /// Whether the block adds its input to its output.
    pub residual: bool,
    /// Probability that training drops the branch for an image.
    pub drop: f32,
}

/// All blocks, and the names of all parameters in torchvision's order.
#[derive(Debug)]
pub struct Architecture {
    pub blocks: Vec<Block>,
    pub head: ConvPlace,
    pub backbone: Vec<Entry>,
    pub classifier: Vec<Entry>,
    pub statistics: Vec<Entry>,
}

/// The entries so far, and the start of the next one.
#[derive(Default)]
struct Names {
    entries: Vec<Entry>,
    end: usize,
}

impl Names {
    fn add(&mut self, name: String, shape: &[usize]) -> Range<usize> {
        let range = self.end..self.end + shape.iter().product::<usize>();
        self.end = range.end;
        self.entries.push(Entry {
            name,
            shape: shape.to_vec(),
            range: range.clone(),
        });
        range
    }
}

#[derive(Default)]
struct Builder {
    parameters: Names,
    statistics: Names,
}

impl Builder {
    fn conv(
        &mut self,
        prefix: &str,
        kind: ConvKind,
        window: Window,
        channels: usize,
        inputs: usize,
    ) -> ConvPlace {
        let shape = [channels, inputs, window.kernel, window.kernel];
        let norm = format!("{prefix}.1");
        ConvPlace {
            kind,
            window,
            weight: self.parameters.add(format!("{prefix}.0.weight"), &shape),
            norm: NormPlace {
                weight: self.parameters.add(format!("{norm}.weight"), &[channels]),
                bias: self.parameters.add(format!("{norm}.bias"), &[channels]),
                mean: self
                    .statistics
                    .add(format!("{norm}.running_mean"), &[channels]),
                variance: self
                    .statistics
                    .add(format!("{norm}.running_var"), &[channels]),
            },
            channels,
            inputs,
        }
    }

    fn pointwise(&mut self, prefix: &str, channels: usize, inputs: usize) -> ConvPlace {
        let pixel = Window::new(1, 1);
        self.conv(prefix, ConvKind::Pointwise, pixel, channels, inputs)
    }

    fn linear(&mut self, prefix: &str, outputs: usize, inputs: usize) -> LinearPlace {
        LinearPlace {
            weight: self
                .parameters
                .add(format!("{prefix}.weight"), &[outputs, inputs, 1, 1]),
            bias: self.parameters.add(format!("{prefix}.bias"), &[outputs]),
        }
    }
}

impl Architecture {
    /// Returns EfficientNet-B0, whose last block is dropped with the probability `stochastic_depth`.
    pub fn new(outputs: usize, stochastic_depth: f32) -> Self {
        Self::of_stages(STEM, &STAGES, FEATURES, outputs, stochastic_depth)
    }

    /// Returns a network of the same kind. Its first stage has no expansion and changes the number of channels.
    pub(super) fn of_stages(
        stem_channels: usize,
        stages: &[Stage],
        features: usize,
        outputs: usize,
        stochastic_depth: f32,
    ) -> Self {
        let mut builder = Builder::default();
        let stem = Window::new(3, 2);
        let stem = builder.conv("features.0", ConvKind::Stem, stem, stem_channels, 1);
        let mut stem = Some(stem);
        let count: usize = stages.iter().map(|stage| stage.4).sum();
        let mut blocks: Vec<Block> = Vec::with_capacity(count);
        let mut channels_in = stem_channels;
        for (stage, (expansion, kernel, stride, channels_out, repeats)) in
            stages.iter().copied().enumerate()
        {
            for repeat in 0..repeats {
                let prefix = format!("features.{}.{repeat}.block", stage + 1);
                let expanded = channels_in * expansion;
                let stride = if repeat == 0 { stride } else { 1 };
                // The first block, the only one without expansion, takes the stem instead.
                let (expand, next) = match stem.take() {
                    Some(stem) => (stem, 0),
                    None => {
                        let prefix = format!("{prefix}.0");
                        (builder.pointwise(&prefix, expanded, channels_in), 1)
                    }
                };
                let (name, window) = (format!("{prefix}.{next}"), Window::new(kernel, stride));
                let depthwise = builder.conv(&name, ConvKind::Depthwise, window, expanded, 1);
                let squeezed = (channels_in / 4).max(1);
                let squeeze = format!("{prefix}.{}", next + 1);
                let squeeze = SqueezePlace {
                    squeeze: builder.linear(&format!("{squeeze}.fc1"), squeezed, expanded),
                    expand: builder.linear(&format!("{squeeze}.fc2"), expanded, squeezed),
                };
                let project = format!("{prefix}.{}", next + 2);
                blocks.push(Block {
                    number: blocks.len(),
                    expand,
                    depthwise,
                    squeeze,
                    project: builder.pointwise(&project, channels_out, expanded),
                    residual: stride == 1 && channels_in == channels_out,
                    drop: stochastic_depth * blocks.len() as f32 / count as f32,
                });
                channels_in = channels_out;
            }
        }
        let head = format!("features.{}", stages.len() + 1);
        let head = builder.pointwise(&head, features, channels_in);
        let mut classifier = Names::default();
        classifier.add("classifier.1.weight".into(), &[outputs, features]);
        classifier.add("classifier.1.bias".into(), &[outputs]);
        Self {
            blocks,
            head,
            backbone: builder.parameters.entries,
            classifier: classifier.entries,
            statistics: builder.statistics.entries,
        }
    }
}
