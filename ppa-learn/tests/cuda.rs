//! Comparison of the network on an NVIDIA device with our kernels on the CPU:
//! `cargo test --release -p ppa-learn --features cuda --test cuda -- --ignored --nocapture`.

use candle_core::{DType, Device, Tensor};
use ppa_learn::{
    DeviceName, EfficientNetB0, Fusion, FusionKind, Mode, Options, QualityNetwork, Targets,
};

fn device() -> Device {
    DeviceName::Cuda(0).open().unwrap()
}

/// Images or targets that are the same on every run.
fn waves(shape: &[usize], device: &Device) -> Tensor {
    let count: usize = shape.iter().product();
    let values: Vec<f32> = (0..count).map(|i| (i as f32 * 0.37).sin()).collect();
    Tensor::from_vec(values, shape, device).unwrap()
}

fn values(tensor: &Tensor) -> Vec<f64> {
    let flat = tensor.to_dtype(DType::F64).unwrap().flatten_all();
    flat.unwrap().to_vec1().unwrap()
}

fn length(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Length of the difference.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    length(&differences)
}

/// Results of a step, and the output in evaluation after it.
struct Step {
    output: Vec<f64>,
    gradients: Vec<(String, Vec<f64>)>,
    statistics: Vec<f64>,
    evaluated: Vec<f64>,
}

fn step(network: &EfficientNetB0) -> Step {
    let images = waves(&[4, 1, 97, 65], network.device());
    let targets = waves(&[4, 1], network.device());
    let output = network.forward(&images, Mode::Train { step: 3 }).unwrap();
    let loss = (&output - targets).unwrap().sqr().unwrap();
    let store = loss.mean_all().unwrap().backward().unwrap();
    let flat = network.variables().map(|v| store.get(v).unwrap());
    let gradients = network.named(flat).unwrap().into_iter();
    let evaluated = network.forward(&images, Mode::Eval).unwrap();
    Step {
        output: values(&output),
        gradients: gradients.map(|n| (n.name, values(&n.tensor))).collect(),
        statistics: values(network.statistics_variable()),
        evaluated: values(&evaluated),
    }
}

#[test]
#[ignore = "needs an NVIDIA device"]
fn a_step_on_the_device_is_that_of_the_cpu() {
    let network = EfficientNetB0::new(5, Options::default()).unwrap();
    let on_device = network.to_device(&device()).unwrap();
    let (found, expected) = (step(&on_device), step(&network));
    for (what, found, expected) in [
        ("output in training", &found.output, &expected.output),
        (
            "running statistics",
            &found.statistics,
            &expected.statistics,
        ),
        (
            "output in evaluation",
            &found.evaluated,
            &expected.evaluated,
        ),
    ] {
        let error = distance(found, expected) / length(expected);
        println!("{what}: {error:.1e}");
        assert!(error < 1e-4, "{what}: {error:.1e}");
    }
    let all = expected.gradients.iter().flat_map(|(_, g)| g.clone());
    let whole = length(&all.collect::<Vec<f64>>());
    for ((name, found), (_, expected)) in found.gradients.iter().zip(&expected.gradients) {
        // Sums that cancel in f32 have errors proportional to the total gradient.
        let allowed = 1e-3 * length(expected) + 1e-5 * whole;
        let error = distance(found, expected);
        assert!(
            error < allowed,
            "{name}: {error:.1e}, allowed {allowed:.1e}"
        );
    }
}

/// The two networks run on two threads, and the layers after them on a third.
#[test]
#[ignore = "needs an NVIDIA device"]
fn networks_of_two_cameras_on_the_device_are_those_of_the_cpu() {
    let fusion = Fusion {
        kind: FusionKind::Late,
        branch_dropout: 0.0,
        ..Fusion::default()
    };
    let options = Options::default();
    let network = QualityNetwork::new(6, options, Some(fusion), Targets::Quality).unwrap();
    let on_device = network.to_device(&device()).unwrap();
    let run = |network: &QualityNetwork, step| {
        let images = [1, 2].map(|moments| {
            let images = waves(&[2 * moments, 1, 97, 65], network.device());
            images.narrow(0, 2 * moments - 2, 2).unwrap()
        });
        let output = network.forward(&images, Mode::Train { step }).unwrap();
        let loss = output.sqr().unwrap().mean_all().unwrap();
        let store = loss.backward().unwrap();
        let gradients = network.variables().into_iter();
        let gradients = gradients.flat_map(|v| values(store.get(v).unwrap()));
        (values(&output), gradients.collect::<Vec<_>>())
    };
    for step in 0..5 {
        let (found, expected) = (run(&on_device, step), run(&network, step));
        let of_output = distance(&found.0, &expected.0) / length(&expected.0);
        let of_gradient = distance(&found.1, &expected.1) / length(&expected.1);
        println!("two cameras: output {of_output:.1e}, gradient {of_gradient:.1e}");
        assert!(
            of_output < 1e-4 && of_gradient < 1e-3,
            "{of_output:.1e}, {of_gradient:.1e}"
        );
    }
}
