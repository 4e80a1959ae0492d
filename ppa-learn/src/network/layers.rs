//! The order of the layers, shared by training, inference, devices and ONNX models.

use super::architecture::{Architecture, Block, ConvPlace};

/// The layers of one implementation of the network, several of them fused if possible.
///
/// A layer takes ownership of values that no later one needs: training keeps them for the gradient, inference frees their memory.
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

    /// Computes the output of a block.
    fn block(&mut self, block: &Block, input: Self::Image) -> Result<Self::Image, Self::Error> {
        let filtered = self.filter(block, &input)?;
        let gate = self.squeeze(block, &filtered)?;
        self.project(block, filtered, gate, input)
    }

    /// Computes the features of images.
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
