//! Properties of a new network.

use candle_core::{Device, Storage, Tensor};
use ppa_learn::{
    EfficientNetB0, InferenceNetwork, Mode, NetworkError, Options, QualityNetwork, Targets,
};

/// Images of smooth waves, different for each number.
fn images(count: usize, height: usize, width: usize) -> Tensor {
    let values: Vec<f32> = (0..count * height * width)
        .map(|i| ((i * i % 8191) as f32 * 0.37).sin() * 0.5)
        .collect();
    Tensor::from_vec(values, (count, 1, height, width), &Device::Cpu).unwrap()
}

fn column(tensor: &Tensor) -> Vec<f32> {
    tensor.flatten_all().unwrap().to_vec1().unwrap()
}

fn gradient(network: &EfficientNetB0, images: &Tensor, step: u64) -> Vec<f32> {
    let loss = network
        .forward(images, Mode::Train { step })
        .unwrap()
        .sqr()
        .unwrap()
        .mean_all()
        .unwrap();
    column(
        loss.backward()
            .unwrap()
            .get(network.variables()[0])
            .unwrap(),
    )
}

#[test]
fn parameters_are_those_of_torchvision_for_one_channel() {
    let network = EfficientNetB0::new(0, Options::default()).unwrap();
    let parameters = network.parameters().unwrap();
    assert_eq!(
        parameters
            .iter()
            .map(|p| p.tensor.elem_count())
            .sum::<usize>(),
        4_008_253
    );
    assert_eq!(parameters[0].name, "features.0.0.weight");
    assert_eq!(parameters[0].tensor.dims(), [32, 1, 3, 3]);
    assert_eq!(parameters.last().unwrap().name, "classifier.1.bias");
    assert_eq!(network.statistics().unwrap().len(), 2 * 49);
}

/// Each named part holds its own values only: 213 clones of all parameters would be 3.4 GB.
#[test]
fn a_named_part_holds_no_more_than_its_own_values() {
    let network = EfficientNetB0::new(0, Options::default()).unwrap();
    let parts = [network.parameters(), network.statistics()];
    for part in parts.into_iter().flat_map(Result::unwrap) {
        let (storage, _) = part.tensor.storage_and_layout();
        let Storage::Cpu(storage) = &*storage else {
            panic!("{} is not in main memory", part.name)
        };
        assert_eq!(
            storage.as_slice::<f32>().unwrap().len(),
            part.tensor.elem_count(),
            "{}",
            part.name
        );
    }
}

#[test]
fn an_image_of_any_size_gives_the_same_alone_and_among_others() {
    let network = EfficientNetB0::new(3, Options::default()).unwrap();
    for (height, width) in [(32, 32), (45, 71), (97, 33)] {
        let batch = images(3, height, width);
        let together = column(&network.forward(&batch, Mode::Eval).unwrap());
        for (index, together) in together.iter().enumerate() {
            let alone = column(
                &network
                    .forward(&batch.narrow(0, index, 1).unwrap(), Mode::Eval)
                    .unwrap(),
            );
            assert!(
                (alone[0] - together).abs() <= 1e-5 * (1.0 + together.abs()),
                "{alone:?} {together}"
            );
        }
    }
}

#[test]
fn seed_and_step_fix_every_byte_for_any_number_of_threads() {
    let run = |threads: usize, step| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            gradient(
                &EfficientNetB0::new(5, Options::default()).unwrap(),
                &images(5, 65, 40),
                step,
            )
        })
    };
    let one = run(1, 0);
    assert!(one.iter().all(|g| g.is_finite()) && one.iter().any(|g| *g != 0.0));
    assert_eq!(one, run(2, 0));
    assert_eq!(one, run(3, 0));
    assert_ne!(one, run(1, 1), "another step leaves out the same");
}

#[test]
fn inference_bytes_do_not_depend_on_threads() {
    let network = QualityNetwork::new(5, Options::default(), None, Targets::Quality).unwrap();
    let inference = InferenceNetwork::new(&network).unwrap();
    let images = [images(3, 97, 65)];
    let expected = column(&network.forward(&images, Mode::Eval).unwrap());
    for variable in network.variables() {
        variable
            .set(&(variable.as_tensor() * 2.0).unwrap())
            .unwrap();
    }
    assert_ne!(
        expected,
        column(&network.forward(&images, Mode::Eval).unwrap())
    );
    for threads in 1..4 {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let run = || column(&inference.forward(&images).unwrap());
        assert_eq!(
            expected,
            pool.build().unwrap().install(run),
            "{threads} threads"
        );
    }
}

#[test]
fn statistics_become_the_mean_of_those_of_the_batches() {
    let network = |options| EfficientNetB0::new(5, options).unwrap();
    let plain = Options {
        dropout: 0.0,
        stochastic_depth: 0.0,
    };
    let all = images(6, 64, 40);
    let batches = [0, 3].map(|start| all.narrow(0, start, 3).unwrap());
    let statistics = |network: &EfficientNetB0| column(network.statistics_variable());
    let after = |network: &EfficientNetB0, of: &[&Tensor]| {
        for (batches, images) in of.iter().enumerate() {
            let batches = batches as u64;
            let mode = Mode::Statistics { batches };
            network.features(images, mode).unwrap();
        }
        statistics(network)
    };
    let [first, second] = &batches;
    let alone = [first, second].map(|batch| after(&network(plain), &[batch]));
    // Previous statistics are forgotten, and no branch is dropped.
    let used = network(Options::default());
    gradient(&used, first, 0);
    let found = after(&used, &[first, second]);
    for ((found, a), b) in found.iter().zip(&alone[0]).zip(&alone[1]) {
        let mean = (a + b) / 2.0;
        assert!(
            (found - mean).abs() < 1e-5 * (1.0 + mean.abs()),
            "{found}, expected {mean}"
        );
    }
    // Training changes them by a tenth from means 0 and variances 1.
    let trained = network(plain);
    gradient(&trained, first, 0);
    let initial = statistics(&network(plain));
    for ((found, a), before) in statistics(&trained).iter().zip(&alone[0]).zip(initial) {
        let expected = 0.9 * before + 0.1 * a;
        assert!((found - expected).abs() < 1e-5 * (1.0 + expected.abs()));
    }
}

#[test]
fn images_of_another_shape_are_refused() {
    let network = EfficientNetB0::new(0, Options::default()).unwrap();
    let three = Tensor::zeros((1, 3, 32, 32), candle_core::DType::F32, &Device::Cpu).unwrap();
    assert!(matches!(
        network.forward(&three, Mode::Eval),
        Err(NetworkError::Shape { .. })
    ));
    let small = images(1, 32, 20);
    assert!(matches!(
        network.forward(&small, Mode::Train { step: 0 }),
        Err(NetworkError::OneValue { .. })
    ));
}
