//! Tests of exported models: each node comes after those that it needs, normalisations are folded in, and evaluating the nodes with
//! candle's own operations gives the outputs of the network.

use std::collections::{HashMap, HashSet};

use candle_core::{Device, Tensor};
use candle_nn::ops::sigmoid;
use prost::Message;
use rand_distr::{Distribution, Uniform};

use super::onnx_messages::{Graph, Model, Node};
use crate::WeightsMetadata;
use crate::network::{
    CORRECTION_UNIT_DEG, Fusion, FusionKind, Mode, Options, QualityNetwork, Targets,
};
use crate::random::{Purpose, stream};

/// A network whose normalisations preserve the magnitude of values, so that predictions depend on the images; for both cameras if
/// `fusion` is given.
fn network(seed: u64, fusion: Option<Fusion>) -> QualityNetwork {
    network_of(Targets::Quality, seed, fusion)
}

fn network_of(targets: Targets, seed: u64, fusion: Option<Fusion>) -> QualityNetwork {
    let network = QualityNetwork::new(seed, Options::default(), fusion, targets).unwrap();
    let tensors = network.tensors().unwrap().into_iter();
    let mut tensors: HashMap<String, Tensor> = tensors.map(|t| (t.name, t.tensor)).collect();
    let variances = tensors.keys().filter(|name| name.ends_with("running_var"));
    for variance in variances.cloned().collect::<Vec<_>>() {
        let weight = &tensors[&variance.replace(".1.running_var", ".0.weight")];
        // About the mean square of the inputs, so that values neither vanish nor grow.
        let squares = weight.sqr().and_then(|w| w.flatten_from(1)?.sum(1)? * 0.4);
        tensors.insert(variance, squares.unwrap());
    }
    for (name, mean) in tensors.iter_mut() {
        if name.ends_with("running_mean") {
            *mean = random(0.1, mean.dims(), seed);
        }
    }
    network.assign(&tensors).unwrap();
    network
}

/// Values uniform in ± `limit`.
fn random(limit: f32, shape: &[usize], index: u64) -> Tensor {
    let uniform = Uniform::new(-limit, limit).unwrap();
    let values = uniform.sample_iter(stream(5, Purpose::Sampling, index));
    let values: Vec<f32> = values.take(shape.iter().product()).collect();
    Tensor::from_vec(values, shape, &Device::Cpu).unwrap()
}

/// Two images of each camera, of equal size.
fn images(network: &QualityNetwork) -> Vec<Tensor> {
    let image = |camera| random(0.5, &[2, 1, 39, 33], camera as u64);
    (0..network.cameras()).map(image).collect()
}

/// Writes the graph to a file and reads it back.
fn written(network: &QualityNetwork) -> Graph {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.onnx");
    network
        .save_onnx(&path, WeightsMetadata::new(true, network.targets()))
        .unwrap();
    let bytes = std::fs::read(path).unwrap();
    let model = Model::decode(&bytes[..]).unwrap();
    let keys: Vec<_> = model.metadata_props.iter().map(|p| &p.key[..]).collect();
    let keys_of = ["correction_unit_deg", "mirror"];
    assert_eq!(keys, keys_of[2 - network.targets().outputs()..]);
    model.graph.unwrap()
}

fn names(values: &[super::onnx_messages::Value]) -> Vec<&str> {
    values.iter().map(|value| value.name.as_str()).collect()
}

fn number(node: &Node, name: &str) -> usize {
    let attribute = node.attribute.iter().find(|a| a.name == name).unwrap();
    (attribute.ints.first().unwrap_or(&attribute.i)).to_owned() as usize
}

/// Evaluates a node.
fn run(node: &Node, inputs: &[&Tensor]) -> candle_core::Result<Tensor> {
    match (node.op_type.as_str(), inputs) {
        ("Conv", [x, weight, bias]) if node.attribute.is_empty() => {
            let bias = bias.reshape((1, (), 1, 1))?;
            x.conv2d(weight, 0, 1, 1, 1)?.broadcast_add(&bias)
        }
        ("Conv", [x, weight, bias]) => {
            let [padding, stride, groups] =
                ["pads", "strides", "group"].map(|name| number(node, name));
            let bias = bias.reshape((1, (), 1, 1))?;
            x.conv2d(weight, padding, stride, 1, groups)?
                .broadcast_add(&bias)
        }
        ("Sigmoid", [x]) => sigmoid(x),
        ("Mul", [x, y]) => x.broadcast_mul(y),
        ("Add", [x, y]) => *x + *y,
        ("GlobalAveragePool", [x]) => x.mean_keepdim((2, 3)),
        ("Flatten", [x]) => x.flatten_from(1),
        ("Gemm", [x, weight, bias]) if number(node, "transB") == 1 => {
            x.matmul(&weight.t()?)?.broadcast_add(bias)
        }
        ("Concat", values) => Tensor::cat(values, number(node, "axis")),
        ("Mean", [x, y]) => (*x + *y)? / 2.0,
        (other, _) => panic!("a node {other} of {} inputs", inputs.len()),
    }
}

/// Evaluates the outputs of a graph for images, checking that each node comes after those that it needs.
fn evaluate(graph: &Graph, images: Vec<Tensor>) -> Vec<Tensor> {
    let weights = graph.initializer.iter().map(|weight| {
        let values = weight.raw_data.as_chunks().0.iter();
        let values: Vec<f32> = values.map(|&bytes| f32::from_le_bytes(bytes)).collect();
        let shape: Vec<usize> = weight.dims.iter().map(|&side| side as usize).collect();
        let tensor = Tensor::from_vec(values, shape, &Device::Cpu).unwrap();
        (weight.name.as_str(), tensor)
    });
    let mut values: HashMap<&str, Tensor> = weights.collect();
    values.extend(names(&graph.input).into_iter().zip(images));
    for node in &graph.node {
        let inputs = node.input.iter().map(|name| match values.get(&name[..]) {
            Some(value) => value,
            None => panic!("{} needs {name}, which is not there", node.name),
        });
        let output = run(node, &inputs.collect::<Vec<_>>()).unwrap();
        let replaced = values.insert(&node.output[0], output);
        assert!(replaced.is_none(), "{} is there twice", node.output[0]);
    }
    let outputs = names(&graph.output).into_iter();
    outputs.map(|name| values[name].clone()).collect()
}

/// Checks a model, and returns its number of nodes and of values in weights.
fn checked(network: &QualityNetwork, cameras: &[&str]) -> (usize, usize) {
    let graph = written(network);
    assert_eq!(names(&graph.input), cameras);
    let outputs = ["quality", "correction_deg"];
    assert_eq!(names(&graph.output), outputs[..network.targets().outputs()]);
    let needed: HashSet<&String> = graph.node.iter().flat_map(|node| &node.input).collect();
    for weight in &graph.initializer {
        assert!(
            needed.contains(&weight.name),
            "nothing needs {}",
            weight.name
        );
    }
    let images = images(network);
    let expected = network.forward(&images, Mode::Eval).unwrap();
    let found = evaluate(&graph, images);
    for (output, found) in found.iter().enumerate() {
        assert_eq!(found.dims(), [2, 1]);
        let unit = [1.0, CORRECTION_UNIT_DEG][output];
        let expected = (expected.narrow(1, output, 1).unwrap() * unit).unwrap();
        let [found, expected] =
            [found, &expected].map(|t| t.flatten_all().unwrap().to_vec1().unwrap());
        for (found, expected) in found.iter().zip(&expected) {
            let (found, expected): (&f32, &f32) = (found, expected);
            assert!(
                (found - expected).abs() < 1e-4 * expected.abs(),
                "{found}, the network says {expected}"
            );
        }
        let spread: f32 = expected[0] - expected[1];
        assert!(
            1e-3 * expected[0].abs() < spread.abs(),
            "equal outputs show nothing: {expected:?}"
        );
    }
    let values = graph.initializer.iter().map(|w| w.raw_data.len() / 4);
    (graph.node.len(), values.sum())
}

/// Values of a single network: 4,008,253 parameters, of which 42,016 are scales and shifts of normalisations; the shifts remain, as biases.
const ONE: usize = 4_008_253 - 42_016 / 2;

#[test]
fn every_node_has_what_it_needs_and_says_what_the_network_says() {
    assert_eq!(checked(&network(3, None), &["images"]).1, ONE);
}

/// With a second row of the last layer.
#[test]
fn corrections_are_an_output_of_their_own() {
    let corrected = |fusion| network_of(Targets::QualityAndCorrection, 3, fusion);
    assert_eq!(checked(&corrected(None), &["images"]).1, ONE + 1281);
    for kind in [FusionKind::Score, FusionKind::Late] {
        for shared_weights in [false, true] {
            let fusion = Fusion {
                kind,
                shared_weights,
                ..Fusion::default()
            };
            checked(&corrected(Some(fusion)), &["left", "right"]);
        }
    }
}

/// Checks the models of separate and shared weights: `extra` nodes join both cameras, each network of `each` values.
fn check_pairs(kind: FusionKind, extra: usize, each: usize, joining: usize) {
    let nodes = written(&network(3, None)).node.len();
    for (shared_weights, networks) in [(false, 2), (true, 1)] {
        let fusion = Fusion {
            kind,
            shared_weights,
            ..Fusion::default()
        };
        let found = checked(&network(3, Some(fusion)), &["left", "right"]);
        let expected = (2 * nodes + extra, networks * each + joining);
        assert_eq!(found, expected, "shared weights: {shared_weights}");
    }
}

#[test]
fn score_fusion_model_holds_shared_weights_once() {
    check_pairs(FusionKind::Score, 1, ONE, 0);
}

/// With 511 more outputs of each network, and layers of 1024 to 256 values to one.
#[test]
fn late_fusion_model_holds_shared_weights_once() {
    check_pairs(FusionKind::Late, 7, ONE + 511 * 1281, 1025 * 256 + 257);
}

#[test]
fn networks_of_two_cameras_are_averaged_in_one_model() {
    let [left, right] = [1, 2].map(|seed| network(seed, None));
    let pair = QualityNetwork::averaged(&left, &right).unwrap();
    checked(&pair, &["left", "right"]);
    let images = images(&pair);
    let say = |network: &QualityNetwork, images: &[Tensor]| -> Vec<f32> {
        let quality = network.forward(images, Mode::Eval).unwrap();
        quality.flatten_all().unwrap().to_vec1().unwrap()
    };
    let [of_left, of_right] = [(&left, 0), (&right, 1)].map(|(n, i)| say(n, &images[i..=i]));
    for (both, (left, right)) in say(&pair, &images)
        .iter()
        .zip(of_left.iter().zip(&of_right))
    {
        assert!((both - (left + right) / 2.0).abs() < 1e-6);
    }
    assert!(QualityNetwork::averaged(&pair, &right).is_err());
}
