//! The network as an ONNX model, with normalisations folded into the convolutions before them.

use std::path::Path;

use prost::Message;

use super::WeightsError;
use super::onnx_messages::{Attribute, Graph, Model, Node, OperatorSet, Tensor, Value};
use crate::network::{Architecture, ConvPlace, EfficientNetB0, SqueezePlace, running};

/// The operators used are those of this version of ONNX's set, and of many before and after it.
const OPERATOR_SET: i64 = 13;
/// The file format that came with it.
const FORMAT: i64 = 7;

impl EfficientNetB0 {
    /// Writes the network for inference as ONNX, whole or not at all: `images` [N, 1, H, W] in f32 to `quality` [N, 1].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_onnx(&self, path: &Path) -> Result<(), WeightsError> {
        let [backbone, classifier] = self.variables().map(|variable| variable.to_vec1::<f32>());
        let statistics = self.statistics_variable().to_vec1::<f32>()?;
        let mut export = Export {
            parameters: &backbone?,
            statistics: &statistics,
            graph: Graph::default(),
        };
        export.network(self.architecture(), &classifier?);
        let graph = Graph {
            name: "efficientnet_b0".into(),
            input: vec![Value::of_floats("images", &[None, Some(1), None, None])],
            output: vec![Value::of_floats("quality", &[None, Some(1)])],
            ..export.graph
        };
        let model = Model {
            ir_version: FORMAT,
            producer_name: "ppa".into(),
            producer_version: env!("CARGO_PKG_VERSION").into(),
            graph: Some(graph),
            opset_import: vec![OperatorSet {
                domain: String::new(),
                version: OPERATOR_SET,
            }],
        };
        Ok(ppa_dataset::write_whole(path, &model.encode_to_vec())?)
    }
}

struct Export<'a> {
    parameters: &'a [f32],
    statistics: &'a [f32],
    graph: Graph,
}

impl Export<'_> {
    fn network(&mut self, architecture: &Architecture, classifier: &[f32]) {
        let mut x = "images".to_owned();
        for (index, block) in architecture.blocks.iter().enumerate() {
            let name = format!("block{index}");
            let input = x.clone();
            let stem = if index == 0 { (3, 2) } else { (1, 1) };
            x = self.conv(&format!("{name}.expand"), &x, &block.expand, stem, 1);
            x = self.silu(&x);
            let window = (block.window.kernel, block.window.stride);
            x = self.conv(
                &format!("{name}.depthwise"),
                &x,
                &block.depthwise,
                window,
                block.depthwise.channels,
            );
            x = self.silu(&x);
            x = self.squeeze(&name, &x, &block.squeeze);
            x = self.conv(&format!("{name}.project"), &x, &block.project, (1, 1), 1);
            if block.residual {
                x = self.node("Add", &[&x, &input], format!("{name}.out"), vec![]);
            }
        }
        x = self.conv("head", &x, &architecture.head, (1, 1), 1);
        x = self.silu(&x);
        x = self.node("GlobalAveragePool", &[&x], "pooled".into(), vec![]);
        x = self.node("Flatten", &[&x], "features".into(), vec![]);
        let (weight, bias) = classifier.split_at(architecture.head.channels);
        let weight = self.constant("classifier.weight", &[1, weight.len()], weight);
        let bias = self.constant("classifier.bias", &[1], bias);
        self.node(
            "Gemm",
            &[&x, &weight, &bias],
            "quality".into(),
            vec![Attribute::int("transB", 1)],
        );
    }

    /// Adds a node with one output, and gives the output's name.
    fn node(
        &mut self,
        operator: &str,
        input: &[&str],
        output: String,
        attribute: Vec<Attribute>,
    ) -> String {
        self.graph.node.push(Node {
            input: input.iter().map(|&name| name.into()).collect(),
            output: vec![output.clone()],
            name: output.clone(),
            op_type: operator.into(),
            attribute,
        });
        output
    }

    fn constant(&mut self, name: &str, shape: &[usize], values: &[f32]) -> String {
        self.graph
            .initializer
            .push(Tensor::of_floats(name, shape, values));
        name.into()
    }

    /// A convolution whose weights and bias hold the normalisation after it.
    fn conv(
        &mut self,
        name: &str,
        input: &str,
        place: &ConvPlace,
        (kernel, stride): (usize, usize),
        groups: usize,
    ) -> String {
        let affine = running(&place.norm, self.parameters, self.statistics);
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
        let weight = self.constant(&format!("{name}.weight"), &shape, &folded);
        let bias = self.constant(&format!("{name}.bias"), &[place.channels], &affine.shift);
        let padding = (kernel - 1) / 2;
        let attributes = vec![
            Attribute::ints("kernel_shape", &[kernel; 2]),
            Attribute::ints("strides", &[stride; 2]),
            Attribute::ints("pads", &[padding; 4]),
            Attribute::int("group", groups),
        ];
        self.node(
            "Conv",
            &[input, &weight, &bias],
            format!("{name}.out"),
            attributes,
        )
    }

    fn silu(&mut self, x: &str) -> String {
        let gate = self.node("Sigmoid", &[x], format!("{x}.sigmoid"), vec![]);
        self.node("Mul", &[x, &gate], format!("{x}.silu"), vec![])
    }

    fn squeeze(&mut self, name: &str, x: &str, place: &SqueezePlace) -> String {
        let (channels, squeezed) = (place.expand_bias.len(), place.squeeze_bias.len());
        let pooled = self.node(
            "GlobalAveragePool",
            &[x],
            format!("{name}.squeeze.pooled"),
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
                gate = self.silu(&gate);
            }
            let weight = &self.parameters[weight.clone()];
            let weight = self.constant(&format!("{name}.squeeze.{layer}.weight"), &shape, weight);
            let bias = &self.parameters[bias.clone()];
            let bias = self.constant(&format!("{name}.squeeze.{layer}.bias"), &[bias.len()], bias);
            gate = self.node(
                "Conv",
                &[&gate, &weight, &bias],
                format!("{name}.squeeze.{layer}"),
                vec![],
            );
        }
        let gate = self.node("Sigmoid", &[&gate], format!("{name}.squeeze.gate"), vec![]);
        self.node("Mul", &[x, &gate], format!("{name}.squeeze.out"), vec![])
    }
}
