//! Export of networks as ONNX models for inference.

use std::path::Path;

use prost::Message;

use super::onnx_messages::{Attribute, Graph, MetadataEntry, Model, OperatorSet, Value};
use super::onnx_network::{Builder, Network};
use super::{WeightsError, WeightsMetadata};
use crate::network::{EfficientNetB0, LateFusion, QualityNetwork, Targets};

/// Version of ONNX's operator set; the operators used are the same in many versions before and after it.
const OPERATOR_SET: i64 = 13;
/// Version of the file format that belongs to it.
const FORMAT: i64 = 7;
/// Names of the images of both cameras.
const CAMERAS: [&str; 2] = ["left", "right"];

impl EfficientNetB0 {
    /// Writes the network for inference atomically as ONNX: `images` [N, 1, H, W] in f32 to `quality` [N, 1].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_onnx(&self, path: &Path) -> Result<(), WeightsError> {
        write(
            path,
            one(self, names(Targets::Quality))?,
            WeightsMetadata::default(),
        )
    }
}

impl QualityNetwork {
    /// Writes the network for inference atomically as ONNX: `images` [N, 1, H, W] in f32 to `quality` [N, 1]; for both cameras
    /// `left` [N, 1, H, W] and `right` [N, 1, H', W'] to `quality` [N, 1]. A network that predicts corrections also has the output
    /// `correction_deg` [N, 1]. Weights shared by both cameras are stored once.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_onnx(&self, path: &Path, metadata: WeightsMetadata) -> Result<(), WeightsError> {
        write(path, model(self)?, metadata)
    }
}

fn model(network: &QualityNetwork) -> Result<Model, WeightsError> {
    match network.cameras() {
        1 => one(&network.branches()[0], names(network.targets())),
        _ => both(network),
    }
}

/// Returns the names of a model's outputs.
fn names(targets: Targets) -> &'static [&'static str] {
    match targets {
        Targets::Quality => &["quality"],
        Targets::QualityAndCorrection => &["quality", "correction_deg"],
    }
}

fn one(network: &EfficientNetB0, outputs: &[&str]) -> Result<Model, WeightsError> {
    let mut builder = Builder::default();
    let network = Network::of(network)?;
    let features = network.features(&mut builder, "images");
    builder.targets("classifier", &features, network.last_layer(), outputs);
    Ok(finished(builder.graph, &["images"], outputs))
}

fn both(network: &QualityNetwork) -> Result<Model, WeightsError> {
    let networks = network.branches().iter().map(Network::of);
    let networks = networks.collect::<Result<Vec<_>, _>>()?;
    let outputs = names(network.targets());
    let mut builder = Builder::default();
    let of_cameras = [0, 1].map(|camera| {
        builder.nodes = ["left.", "right."][camera];
        let (of_camera, weights) = match &networks[..] {
            [shared] => (shared, ""),
            separate => (&separate[camera], builder.nodes),
        };
        builder.weights = weights;
        let features = of_camera.features(&mut builder, CAMERAS[camera]);
        let [weight, bias] = of_camera.last_layer();
        match network.late() {
            None => builder.targets("classifier", &features, [weight, bias], outputs),
            Some(_) => vec![builder.linear("classifier", &features, weight, bias, "output")],
        }
    });
    (builder.nodes, builder.weights) = ("", "");
    let [left, right] = of_cameras;
    let pairs = left.iter().zip(&right);
    match network.late() {
        None => {
            for ((left, right), output) in pairs.zip(outputs) {
                builder.node("Mean", &[left, right], output, vec![]);
            }
        }
        Some(late) => join(&mut builder, late, [&left[0], &right[0]], outputs)?,
    }
    Ok(finished(builder.graph, &CAMERAS, outputs))
}

/// Adds the layers of late fusion, from the values of both cameras to the model's outputs.
fn join(
    builder: &mut Builder,
    late: &LateFusion,
    values: [&str; 2],
    outputs: &[&str],
) -> Result<(), WeightsError> {
    let parameters: Vec<f32> = late.variable().to_vec1()?;
    let part = |index: usize| &parameters[late.entries()[index].range.clone()];
    let joined = builder.node("Concat", &values, "joined", vec![Attribute::int("axis", 1)]);
    let x = builder.silu(&joined);
    let x = builder.linear("fc.0", &x, part(0), part(1), "hidden");
    let x = builder.silu(&x);
    builder.targets("fc.3", &x, [part(2), part(3)], outputs);
    Ok(())
}

/// Makes a model from a graph that computes outputs from images.
fn finished(graph: Graph, images: &[&str], outputs: &[&str]) -> Model {
    let images = images
        .iter()
        .map(|name| Value::of_floats(name, &[None, Some(1), None, None]));
    let outputs = outputs.iter();
    let graph = Graph {
        name: "efficientnet_b0".into(),
        input: images.collect(),
        output: outputs
            .map(|name| Value::of_floats(name, &[None, Some(1)]))
            .collect(),
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
    let entries = metadata.entries().into_iter();
    let entries = entries.map(|(key, value)| MetadataEntry { key, value });
    model.metadata_props = entries.collect();
    Ok(ppa_dataset::write_whole(path, &model.encode_to_vec())?)
}
