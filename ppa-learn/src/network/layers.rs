//! The order of the layers, which training, inference, devices and ONNX models share.

use super::architecture::{Architecture, Block, ConvPlace};

/// The layers of one form of the network, several of them fused where that form can do so.
///
/// A layer owns what no later one needs: training keeps it for the gradient, inference gives its memory back.
pub trait Layers {
    /// Images, or the output of a block.
    type Image;
    type Filtered;
    /// A gate for each channel.
    type Gate;
    type Features;
    type Error;

    /// The stem or the expansion and the depthwise convolution, each with its normalisation and SiLU.
    fn filter(&mut self, block: &Block, input: &Self::Image)
    -> Result<Self::Filtered, Self::Error>;

    /// The squeeze-and-excitation, up to its gates.
    fn squeeze(
        &mut self,
        block: &Block,
        filtered: &Self::Filtered,
    ) -> Result<Self::Gate, Self::Error>;

    /// The projection of the gated channels and its normalisation; a residual block adds its input.
    fn project(
        &mut self,
        block: &Block,
        filtered: Self::Filtered,
        gate: Self::Gate,
        input: Self::Image,
    ) -> Result<Self::Image, Self::Error>;

    /// The last convolution, its normalisation and SiLU, and the mean of each channel over each image.
    fn head(
        &mut self,
        place: &ConvPlace,
        input: Self::Image,
    ) -> Result<Self::Features, Self::Error>;

    /// The output of a block.
    fn block(&mut self, block: &Block, input: Self::Image) -> Result<Self::Image, Self::Error> {
        let filtered = self.filter(block, &input)?;
        let gate = self.squeeze(block, &filtered)?;
        self.project(block, filtered, gate, input)
    }

    /// The features of images.
    fn features(
        &mut self,
        architecture: &Architecture,
        images: Self::Image,
    ) -> Result<Self::Features, Self::Error> {
        let mut blocks = architecture.blocks.iter();
        let output = blocks.try_fold(images, |input, block| self.block(block, input))?;
        self.head(&architecture.head, output)
    }
}
