//! The nodes of one EfficientNet-B0, with normalisations folded into the convolutions before them.

use super::WeightsError;
use super::onnx_messages::{Attribute, Graph, Node, Tensor};
use crate::network::{Architecture, ConvPlace, EfficientNetB0, SqueezePlace, running};

/// A graph that grows, and what stands before the names of what is added now.
#[derive(Default)]
pub struct Builder {
    pub graph: Graph,
    /// Before the names of nodes.
    pub nodes: &'static str,
    /// Before the names of weights, which nodes of several names can share.
    pub weights: &'static str,
}

impl Builder {
    /// Adds a node with one output, and gives the output's name.
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

    /// The name of a weight, which is added unless it is there.
    fn constant(&mut self, name: &str, shape: &[usize], values: &[f32]) -> String {
        let name = format!("{}{name}", self.weights);
        let there = &mut self.graph.initializer;
        if there.iter().all(|tensor| tensor.name != name) {
            there.push(Tensor::of_floats(&name, shape, values));
        }
        name
    }

    /// A layer of which every output depends on every input, from its weight [out, in] and its bias.
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

    /// x * sigmoid(x), under a name that follows from `x`'s.
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

    /// Adds what leads from `images` to `output` [N, outputs], and gives the latter's name.
    pub fn add(&self, builder: &mut Builder, images: &str, output: &str) -> String {
        let architecture = self.architecture;
        let mut x = images.to_owned();
        for (index, block) in architecture.blocks.iter().enumerate() {
            let name = format!("block{index}");
            let input = x.clone();
            let stem = if index == 0 { (3, 2) } else { (1, 1) };
            x = self.conv(
                builder,
                &format!("{name}.expand"),
                &x,
                &block.expand,
                stem,
                1,
            );
            x = builder.silu(&x);
            let window = (block.window.kernel, block.window.stride);
            x = self.conv(
                builder,
                &format!("{name}.depthwise"),
                &x,
                &block.depthwise,
                window,
                block.depthwise.channels,
            );
            x = builder.silu(&x);
            x = self.squeeze(builder, &name, &x, &block.squeeze);
            x = self.conv(
                builder,
                &format!("{name}.project"),
                &x,
                &block.project,
                (1, 1),
                1,
            );
            if block.residual {
                x = builder.node("Add", &[&x, &input], &format!("{name}.out"), vec![]);
            }
        }
        x = self.conv(builder, "head", &x, &architecture.head, (1, 1), 1);
        x = builder.silu(&x);
        x = builder.node("GlobalAveragePool", &[&x], "pooled", vec![]);
        x = builder.node("Flatten", &[&x], "features", vec![]);
        let [weight, bias] = [0, 1].map(|part| {
            let entry = &architecture.classifier[part];
            &self.classifier[entry.range.clone()]
        });
        builder.linear("classifier", &x, weight, bias, output)
    }

    /// A convolution whose weights and bias hold the normalisation after it.
    fn conv(
        &self,
        builder: &mut Builder,
        name: &str,
        input: &str,
        place: &ConvPlace,
        (kernel, stride): (usize, usize),
        groups: usize,
    ) -> String {
        let affine = running(&place.norm, &self.parameters, &self.statistics);
        let weight = &self.parameters[place.weight.clone()];
        let per_channel = weight.len() / place.channels;
        let folded: Vec<f32> = weight
            .iter()
            .enumerate()
            .map(|(i, weight)| weight * affine.scale[i / per_channel])
            .collect();
        let shape = [
            place.channels,
            per_channel / (kernel * kernel),
            kernel,
            kernel,
        ];
        let weight = builder.constant(&format!("{name}.weight"), &shape, &folded);
        let bias = builder.constant(&format!("{name}.bias"), &[place.channels], &affine.shift);
        let padding = (kernel - 1) / 2;
        let attributes = vec![
            Attribute::ints("kernel_shape", &[kernel; 2]),
            Attribute::ints("strides", &[stride; 2]),
            Attribute::ints("pads", &[padding; 4]),
            Attribute::int("group", groups),
        ];
        builder.node(
            "Conv",
            &[input, &weight, &bias],
            &format!("{name}.out"),
            attributes,
        )
    }

    fn squeeze(&self, builder: &mut Builder, name: &str, x: &str, place: &SqueezePlace) -> String {
        let (channels, squeezed) = (place.expand_bias.len(), place.squeeze_bias.len());
        let pooled = builder.node(
            "GlobalAveragePool",
            &[x],
            &format!("{name}.squeeze.pooled"),
            vec![],
        );
        let layers = [
            (
                "fc1",
                &place.squeeze_weight,
                &place.squeeze_bias,
                [squeezed, channels, 1, 1],
            ),
            (
                "fc2",
                &place.expand_weight,
                &place.expand_bias,
                [channels, squeezed, 1, 1],
            ),
        ];
        let mut gate = pooled;
        for (layer, weight, bias, shape) in layers {
            if layer == "fc2" {
                gate = builder.silu(&gate);
            }
            let weight = &self.parameters[weight.clone()];
            let weight =
                builder.constant(&format!("{name}.squeeze.{layer}.weight"), &shape, weight);
            let bias = &self.parameters[bias.clone()];
            let bias =
                builder.constant(&format!("{name}.squeeze.{layer}.bias"), &[bias.len()], bias);
            gate = builder.node(
                "Conv",
                &[&gate, &weight, &bias],
                &format!("{name}.squeeze.{layer}"),
                vec![],
            );
        }
        let gate = builder.node("Sigmoid", &[&gate], &format!("{name}.squeeze.gate"), vec![]);
        builder.node("Mul", &[x, &gate], &format!("{name}.squeeze.out"), vec![])
    }
}
