//! The network on devices, computed by emulated kernels and compared with our CPU kernels and with PyTorch.

use std::collections::HashMap;
use std::path::PathBuf;

use candle_core::{DType, Device, Result, Tensor};
use rand_distr::{Distribution, StandardNormal};

use super::*;

/// Results of a training pass.
struct Trained {
    output: Vec<f64>,
    gradients: Vec<(String, Vec<f64>)>,
    statistics: Vec<f64>,
}

fn values(tensor: &Tensor) -> Vec<f64> {
    let flat = tensor.to_dtype(DType::F64).unwrap().flatten_all();
    flat.unwrap().to_vec1().unwrap()
}

fn length(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    difference(a, b).iter().fold(0.0, |m, d| d.abs().max(m))
}

/// The features as another device would compute them.
fn device_features(network: &EfficientNetB0, images: &Tensor, mode: Mode) -> Result<Tensor> {
    on_device::features(network, images, mode)
}

fn cpu_features(network: &EfficientNetB0, images: &Tensor, mode: Mode) -> Result<Tensor> {
    Ok(network.features(images, mode).unwrap())
}

type Features = fn(&EfficientNetB0, &Tensor, Mode) -> Result<Tensor>;

fn evaluated(network: &EfficientNetB0, images: &Tensor, features: Features) -> Vec<f64> {
    let features = features(network, images, Mode::Eval).unwrap();
    values(&network.classify(&features, Mode::Eval).unwrap())
}

fn trained(
    network: &EfficientNetB0,
    images: &Tensor,
    targets: &Tensor,
    features: Features,
) -> Trained {
    let mode = Mode::Train { step: 3 };
    let features = features(network, images, mode).unwrap();
    let output = network.classify(&features, mode).unwrap();
    let loss = (&output - targets).unwrap().sqr().unwrap();
    let store = loss.mean_all().unwrap().backward().unwrap();
    let flat = network.variables().map(|v| store.get(v).unwrap());
    let named = network.named(flat).unwrap().into_iter();
    Trained {
        output: values(&output),
        gradients: named.map(|n| (n.name, values(&n.tensor))).collect(),
        statistics: values(network.statistics_variable()),
    }
}

fn random(shape: &[usize], seed: u64) -> Tensor {
    let random = stream(seed, Purpose::Sampling, 0);
    let count = shape.iter().product();
    let values: Vec<f32> = StandardNormal.sample_iter(random).take(count).collect();
    Tensor::from_vec(values, shape, &Device::Cpu).unwrap()
}

/// A network whose parameters are all away from 0 and 1, so that every term counts.
fn disturbed(options: Options) -> EfficientNetB0 {
    let network = EfficientNetB0::new(5, options).unwrap();
    for (variable, seed) in [(&network.backbone, 1), (&network.classifier, 2)] {
        let noise = (random(variable.dims(), seed) * 0.05).unwrap();
        variable
            .set(&(variable.as_tensor() + noise).unwrap())
            .unwrap();
    }
    network
}

#[test]
fn device_and_cpu_agree_in_outputs_and_gradients() {
    let network = disturbed(Options::default());
    let twin = network.to_device(&Device::Cpu).unwrap();
    // Not square; sides are odd before some blocks and even before others, and 3 x 2 pixels in the end.
    let input = random(&[4, 1, 65, 47], 7);
    let targets = random(&[4, 1], 8);
    let on_device = trained(&network, &input, &targets, device_features);
    let on_cpu = trained(&twin, &input, &targets, cpu_features);

    let error = length(&difference(&on_device.output, &on_cpu.output));
    let size = length(&on_cpu.output);
    println!("outputs {error:.1e} of {size:.1}");
    assert!(error < 1e-4 * size, "outputs {error:.1e} of {size}");

    let statistics = difference(&on_device.statistics, &on_cpu.statistics);
    let relative = |(error, value): (&f64, &f64)| error.abs() / (1.0 + value.abs());
    let errors = statistics.iter().zip(&on_cpu.statistics).map(relative);
    let worst = errors.fold(0.0, f64::max);
    println!("statistics {worst:.1e}");
    assert!(worst < 1e-5, "statistics {worst:.1e}");

    let all = on_cpu.gradients.iter().flat_map(|(_, g)| g.clone());
    let whole = length(&all.collect::<Vec<f64>>());
    let pairs = on_device.gradients.iter().zip(&on_cpu.gradients);
    let errors = pairs.map(|((name, device), (_, cpu))| {
        // Sums that cancel in f32, such as those of biases before another normalisation, have errors proportional to the total gradient.
        let allowed = length(cpu) + 1e-2 * whole;
        (length(&difference(device, cpu)) / allowed, name)
    });
    let (worst, name) = errors.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    println!("gradients {worst:.1e} at {name}");
    // Normalisation by the 24 values of a channel in the last blocks amplifies rounding errors of f32.
    assert!(worst < 1e-3, "gradient of {name}: {worst:.1e}");

    // With the running statistics, which training changed from 0 and 1.
    let [device, cpu] =
        [device_features as Features, cpu_features].map(|f| evaluated(&twin, &input, f));
    let error = length(&difference(&device, &cpu));
    println!("evaluation {error:.1e} of {:.1}", length(&cpu));
    assert!(error < 1e-5 * length(&cpu), "evaluation {error:.1e}");
}

#[test]
fn device_and_cpu_agree_in_the_mean_of_statistics() {
    let network = disturbed(Options::default());
    let twin = network.to_device(&Device::Cpu).unwrap();
    for batches in 0..2 {
        let input = random(&[4, 1, 65, 47], 7 + batches);
        let mode = Mode::Statistics { batches };
        device_features(&network, &input, mode).unwrap();
        cpu_features(&twin, &input, mode).unwrap();
    }
    let [device, cpu] = [&network, &twin].map(|n| values(n.statistics_variable()));
    let relative = |(device, cpu): (&f64, &f64)| (device - cpu).abs() / (1.0 + cpu.abs());
    let worst = device.iter().zip(&cpu).map(relative).fold(0.0, f64::max);
    // Ten times what a training step is allowed, of which a tenth enters.
    assert!(worst < 1e-4, "{worst:.1e}");
}

fn reference(name: &str) -> PathBuf {
    std::env::var_os("PPA_SHARED")
        .map_or_else(|| PathBuf::from("../../shared"), PathBuf::from)
        .join("reference/learn")
        .join(name)
}

#[test]
#[ignore = "needs the reference values of PyTorch in PPA_SHARED"]
fn device_is_that_of_pytorch() {
    let load = |name| candle_core::safetensors::load(reference(name), &Device::Cpu).unwrap();
    let io: HashMap<String, Tensor> = load("b0_seed1_io.safetensors");
    let still = Options {
        dropout: 0.0,
        stochastic_depth: 0.0,
    };
    let network = EfficientNetB0::new(1, still).unwrap();
    network
        .assign(&load("b0_seed1_weights.safetensors"))
        .unwrap();
    for (input, expected) in [
        ("input", "eval_output_f64"),
        ("extra0_input", "extra0_eval_output"),
    ] {
        let output = evaluated(&network, &io[input], device_features);
        let error = largest_difference(&output, &values(&io[expected]));
        println!("{input}: {error:.1e}");
        assert!(error < 1e-5, "{input}: {error}");
    }
    let target = &io["target"];
    let trained = trained(&network, &io["input"], target, device_features);
    let loss = |output: &[f64]| {
        let errors = difference(output, &values(target));
        errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64
    };
    let (loss, expected) = (
        loss(&trained.output),
        loss(&values(&io["train_output_f64"])),
    );
    println!("loss {loss} {expected}");
    assert!(
        (loss - expected).abs() < 1e-6 * expected,
        "{loss} {expected}"
    );
    let all: Vec<f64> = trained
        .gradients
        .iter()
        .flat_map(|(_, g)| g.clone())
        .collect();
    let (mut worst, mut compared) = (0.0_f64, 0);
    for (name, gradient) in &trained.gradients {
        let Some(expected) = io.get(&format!("grad_f64.{name}")) else {
            continue;
        };
        let expected = values(expected);
        // A bias before another normalisation has a gradient of zero.
        if 1e-6 * length(&all) < length(&expected) {
            worst = worst.max(length(&difference(gradient, &expected)) / length(&expected));
            compared += 1;
        }
    }
    println!("worst of {compared} gradients {worst:.1e}");
    assert!(compared > 0 && worst < 1e-4, "{worst}");
    for named in network.statistics().unwrap() {
        if let Some(expected) = io.get(&format!("after_train_f64.{}", named.name)) {
            let (found, expected) = (values(&named.tensor), values(expected));
            let error = largest_difference(&found, &expected);
            assert!(
                error < 1e-5 * (1.0 + length(&expected)),
                "{}: {error}",
                named.name
            );
        }
    }
}
