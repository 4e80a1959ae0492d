//! The nodes of one EfficientNet-B0, with normalisations folded into the convolutions before them.

use std::convert::Infallible;

use super::WeightsError;
use super::onnx_messages::{Attribute, Graph, Node, Tensor};
use crate::network::{
    Architecture, Block, CORRECTION_UNIT_DEG, ConvKind, ConvPlace, EfficientNetB0, Layers,
    LinearPlace, SqueezePlace, running,
};

/// A graph under construction, and the prefixes for the names of added elements.
#[derive(Default)]
pub struct Builder {
    pub graph: Graph,
    /// Prefix of the names of nodes.
    pub nodes: &'static str,
    /// Prefix of the names of weights, which nodes with different prefixes can share.
    pub weights: &'static str,
}

impl Builder {
    /// Adds a node with one output and returns the output's name.
    pub fn node(
        &mut self,
        operator: &str,
        input: &[&str],
        output: &str,
        attribute: Vec<Attribute>,
    ) -> String {
        let output = format!("{}{output}", self.nodes);
        self.graph.node.push(Node {
            input: input.iter().map(|&name| name.into()).collect(),
            output: vec![output.clone()],
            name: output.clone(),
            op_type: operator.into(),
            attribute,
        });
        output
    }

    /// Returns the name of a weight, which is added unless it exists.
    fn constant(&mut self, name: &str, shape: &[usize], values: &[f32]) -> String {
        let name = format!("{}{name}", self.weights);
        let there = &mut self.graph.initializer;
        if there.iter().all(|tensor| tensor.name != name) {
            there.push(Tensor::of_floats(&name, shape, values));
        }
        name
    }

    /// Adds a fully connected layer with weight [out, in] and bias.
    pub fn linear(
        &mut self,
        name: &str,
        x: &str,
        weight: &[f32],
        bias: &[f32],
        out: &str,
    ) -> String {
        let shape = [bias.len(), weight.len() / bias.len()];
        let weight = self.constant(&format!("{name}.weight"), &shape, weight);
        let bias = self.constant(&format!("{name}.bias"), &shape[..1], bias);
        let transposed = vec![Attribute::int("transB", 1)];
        self.node("Gemm", &[x, &weight, &bias], out, transposed)
    }

    /// Adds the last layer, with one output [N, 1] for each name: the quality, then the correction in degrees.
    pub fn targets(
        &mut self,
        name: &str,
        x: &str,
        [weight, bias]: [&[f32]; 2],
        outputs: &[&str],
    ) -> Vec<String> {
        let columns = weight.len() / bias.len();
        let rows = weight.chunks(columns).zip(bias).zip(outputs);
        let target = |(place, ((weight, &bias), output)): (usize, ((&[f32], _), &&str))| match place
        {
            0 => self.linear(name, x, weight, &[bias], output),
            _ => {
                let degrees = |value: f32| CORRECTION_UNIT_DEG as f32 * value;
                let weight: Vec<f32> = weight.iter().copied().map(degrees).collect();
                let name = format!("{name}.correction");
                self.linear(&name, x, &weight, &[degrees(bias)], output)
            }
        };
        rows.enumerate().map(target).collect()
    }

    /// Adds the mean of each channel.
    fn pooled(&mut self, x: &str, output: &str) -> String {
        self.node("GlobalAveragePool", &[x], output, vec![])
    }

    /// Adds x * sigmoid(x), with a name derived from `x`'s.
    pub fn silu(&mut self, x: &str) -> String {
        let name = x.strip_prefix(self.nodes).unwrap_or(x).to_owned();
        let gate = self.node("Sigmoid", &[x], &format!("{name}.sigmoid"), vec![]);
        self.node("Mul", &[x, &gate], &format!("{name}.silu"), vec![])
    }
}

/// The backbone and the last layer of one network, from its flat values.
pub struct Network<'a> {
    architecture: &'a Architecture,
    parameters: Vec<f32>,
    classifier: Vec<f32>,
    statistics: Vec<f32>,
}

impl<'a> Network<'a> {
    pub fn of(network: &'a EfficientNetB0) -> Result<Self, WeightsError> {
        let [backbone, classifier] = network.variables();
        Ok(Self {
            architecture: network.architecture(),
            parameters: backbone.to_vec1()?,
            classifier: classifier.to_vec1()?,
            statistics: network.statistics_variable().to_vec1()?,
        })
    }

    /// Adds the backbone from `images` to the features, the input of the last layer, and returns their name.
    pub fn features(&self, builder: &mut Builder, images: &str) -> String {
        let mut nodes = Nodes {
            network: self,
            builder,
        };
        let Ok(features) = nodes.features(self.architecture, images.to_owned());
        features
    }

    /// Returns weight and bias of the last layer.
    pub fn last_layer(&self) -> [&[f32]; 2] {
        [0, 1].map(|part| {
            let entry = &self.architecture.classifier[part];
            &self.classifier[entry.range.clone()]
        })
    }
}

/// The nodes of a backbone; layers pass names of outputs to each other.
struct Nodes<'a> {
    network: &'a Network<'a>,
    builder: &'a mut Builder,
}

impl Layers for Nodes<'_> {
    type Image = String;
    type Filtered = String;
    type Gate = String;
    type Features = String;
    type Error = Infallible;

    fn filter(&mut self, block: &Block, x: &String) -> Result<String, Infallible> {
        let x = self.conv(&format!("block{}.expand", block.number), x, &block.expand);
        let x = self.builder.silu(&x);
        let name = format!("block{}.depthwise", block.number);
        let x = self.conv(&name, &x, &block.depthwise);
        Ok(self.builder.silu(&x))
    }

    fn squeeze(&mut self, block: &Block, x: &String) -> Result<String, Infallible> {
        let name = format!("block{}.squeeze", block.number);
        let SqueezePlace { squeeze, expand } = &block.squeeze;
        let pooled = self.builder.pooled(x, &format!("{name}.pooled"));
        let hidden = self.gate_layer(&format!("{name}.fc1"), &pooled, squeeze);
        let hidden = self.builder.silu(&hidden);
        let gate = self.gate_layer(&format!("{name}.fc2"), &hidden, expand);
        let name = format!("{name}.gate");
        Ok(self.builder.node("Sigmoid", &[&gate], &name, vec![]))
    }

    fn project(
        &mut self,
        block: &Block,
        x: String,
        gate: String,
        input: String,
    ) -> Result<String, Infallible> {
        let name = format!("block{}", block.number);
        let gated = format!("{name}.squeeze.out");
        let gated = self.builder.node("Mul", &[&x, &gate], &gated, vec![]);
        let x = self.conv(&format!("{name}.project"), &gated, &block.project);
        if !block.residual {
            return Ok(x);
        }
        let out = format!("{name}.out");
        Ok(self.builder.node("Add", &[&x, &input], &out, vec![]))
    }

    fn head(&mut self, place: &ConvPlace, x: String) -> Result<String, Infallible> {
        let x = self.conv("head", &x, place);
        let x = self.builder.silu(&x);
        let pooled = self.builder.pooled(&x, "pooled");
        Ok(self.builder.node("Flatten", &[&pooled], "features", vec![]))
    }
}

impl Nodes<'_> {
    /// Adds a convolution with the normalisation after it folded into weights and bias.
    fn conv(&mut self, name: &str, input: &str, place: &ConvPlace) -> String {
        let Network {
            parameters,
            statistics,
            ..
        } = self.network;
        let affine = running(&place.norm, parameters, statistics);
        let weight = &parameters[place.weight.clone()];
        let per_channel = weight.len() / place.channels;
        let folded: Vec<f32> = weight
            .iter()
            .enumerate()
            .map(|(i, weight)| weight * affine.scale[i / per_channel])
            .collect();
        let (channels, kernel) = (place.channels, place.window.kernel);
        let shape = [channels, place.inputs, kernel, kernel];
        let groups = match place.kind {
            ConvKind::Depthwise => channels,
            ConvKind::Stem | ConvKind::Pointwise => 1,
        };
        let builder = &mut *self.builder;
        let weight = builder.constant(&format!("{name}.weight"), &shape, &folded);
        let bias = builder.constant(&format!("{name}.bias"), &[channels], &affine.shift);
        let attributes = vec![
            Attribute::ints("kernel_shape", &[kernel; 2]),
            Attribute::ints("strides", &[place.window.stride; 2]),
            Attribute::ints("pads", &[place.window.padding(); 4]),
            Attribute::int("group", groups),
        ];
        let input = [input, &weight, &bias];
        builder.node("Conv", &input, &format!("{name}.out"), attributes)
    }

    /// Adds a layer of a squeeze-and-excitation, as a convolution of one pixel.
    fn gate_layer(&mut self, name: &str, x: &str, place: &LinearPlace) -> String {
        let weight = &self.network.parameters[place.weight.clone()];
        let bias = &self.network.parameters[place.bias.clone()];
        let shape = [bias.len(), weight.len() / bias.len(), 1, 1];
        let builder = &mut *self.builder;
        let weight = builder.constant(&format!("{name}.weight"), &shape, weight);
        let bias = builder.constant(&format!("{name}.bias"), &shape[..1], bias);
        builder.node("Conv", &[x, &weight, &bias], name, vec![])
    }
}
