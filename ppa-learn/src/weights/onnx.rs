//! Networks as ONNX models, for inference.

use std::path::Path;

use prost::Message;

use super::onnx_messages::{Attribute, Graph, MetadataEntry, Model, OperatorSet, Value};
use super::onnx_network::{Builder, Network};
use super::{WeightsError, WeightsMetadata};
use crate::network::{EfficientNetB0, LateFusion, QualityNetwork};

/// The operators used are those of this version of ONNX's set, and of many before and after it.
const OPERATOR_SET: i64 = 13;
/// The file format that came with it.
const FORMAT: i64 = 7;
/// Names of the images of both cameras.
const CAMERAS: [&str; 2] = ["left", "right"];

impl EfficientNetB0 {
    /// Writes the network for inference as ONNX, whole or not at all: `images` [N, 1, H, W] in f32 to `quality` [N, 1].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_onnx(&self, path: &Path) -> Result<(), WeightsError> {
        write(path, one(self)?, WeightsMetadata::default())
    }
}

impl QualityNetwork {
    /// Writes the network for inference as ONNX, whole or not at all: `images` [N, 1, H, W] in f32 to `quality` [N, 1]; of both
    /// cameras `left` [N, 1, H, W] and `right` [N, 1, H', W'] to `quality` [N, 1]. Weights that both cameras share are in it once.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_onnx(&self, path: &Path, metadata: WeightsMetadata) -> Result<(), WeightsError> {
        write(path, model(self)?, metadata)
    }
}

fn model(network: &QualityNetwork) -> Result<Model, WeightsError> {
    match network.cameras() {
        1 => one(&network.branches()[0]),
        _ => both(network),
    }
}

fn one(network: &EfficientNetB0) -> Result<Model, WeightsError> {
    let mut builder = Builder::default();
    Network::of(network)?.add(&mut builder, "images", "quality");
    Ok(finished(builder.graph, &["images"]))
}

fn both(network: &QualityNetwork) -> Result<Model, WeightsError> {
    let networks = network.branches().iter().map(Network::of);
    let networks = networks.collect::<Result<Vec<_>, _>>()?;
    let mut builder = Builder::default();
    let outputs = [0, 1].map(|camera| {
        builder.nodes = ["left.", "right."][camera];
        let (network, weights) = match &networks[..] {
            [shared] => (shared, ""),
            separate => (&separate[camera], builder.nodes),
        };
        builder.weights = weights;
        network.add(&mut builder, CAMERAS[camera], "output")
    });
    (builder.nodes, builder.weights) = ("", "");
    let outputs = outputs.each_ref().map(String::as_str);
    match network.late() {
        None => {
            builder.node("Mean", &outputs, "quality", vec![]);
        }
        Some(late) => join(&mut builder, late, &outputs)?,
    }
    Ok(finished(builder.graph, &CAMERAS))
}

/// The layers of late fusion, from the values of both cameras to `quality`.
fn join(builder: &mut Builder, late: &LateFusion, outputs: &[&str]) -> Result<(), WeightsError> {
    let values: Vec<f32> = late.variable().to_vec1()?;
    let part = |index: usize| &values[late.entries()[index].range.clone()];
    let joined = builder.node("Concat", outputs, "joined", vec![Attribute::int("axis", 1)]);
    let x = builder.silu(&joined);
    let x = builder.linear("fc.0", &x, part(0), part(1), "hidden");
    let x = builder.silu(&x);
    builder.linear("fc.3", &x, part(2), part(3), "quality");
    Ok(())
}

/// A model of a graph that leads from images to `quality`.
fn finished(graph: Graph, images: &[&str]) -> Model {
    let images = images
        .iter()
        .map(|name| Value::of_floats(name, &[None, Some(1), None, None]));
    let graph = Graph {
        name: "efficientnet_b0".into(),
        input: images.collect(),
        output: vec![Value::of_floats("quality", &[None, Some(1)])],
        ..graph
    };
    Model {
        ir_version: FORMAT,
        producer_name: "ppa".into(),
        producer_version: env!("CARGO_PKG_VERSION").into(),
        graph: Some(graph),
        opset_import: vec![OperatorSet {
            domain: String::new(),
            version: OPERATOR_SET,
        }],
        metadata_props: Vec::new(),
    }
}

fn write(path: &Path, mut model: Model, metadata: WeightsMetadata) -> Result<(), WeightsError> {
    let entries = metadata.entries().into_iter().flatten();
    let entries = entries.map(|(key, value)| MetadataEntry { key, value });
    model.metadata_props = entries.collect();
    Ok(ppa_dataset::write_whole(path, &model.encode_to_vec())?)
}
