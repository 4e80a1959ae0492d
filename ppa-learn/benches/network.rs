//! Images per processor second of EfficientNet-B0 on images of 96 x 96 pixels; the example `speed` takes those of the paper.

use candle_core::{Device, Tensor};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ppa_benches::ProcessorTime;
use ppa_learn::{EfficientNetB0, InferenceNetwork, Mode, Options, QualityNetwork, Targets};

const SIDE: usize = 96;

fn images(count: usize) -> Tensor {
    let pixels = (0..count * SIDE * SIDE).map(|pixel| (pixel as f32 * 0.37).sin());
    let shape = (count, 1, SIDE, SIDE);
    Tensor::from_vec(pixels.collect::<Vec<f32>>(), shape, &Device::Cpu).expect("a tensor")
}

fn network(c: &mut Criterion<ProcessorTime>) {
    let mut group = c.benchmark_group("efficientnet_b0");
    group.sample_size(10);
    let one = [images(1)];
    let quality =
        QualityNetwork::new(0, Options::default(), None, Targets::Quality).expect("a network");
    let inference = InferenceNetwork::new(&quality).expect("a network");
    group.throughput(Throughput::Elements(1));
    group.bench_function("inference", |b| b.iter(|| inference.forward(&one)));

    let batch = images(8);
    let trained = EfficientNetB0::new(0, Options::default()).expect("a network");
    group.throughput(Throughput::Elements(8));
    group.bench_function("gradient_of_a_batch", |b| {
        b.iter(|| {
            let outputs = trained
                .forward(&batch, Mode::Train { step: 0 })
                .expect("outputs");
            outputs.sqr()?.mean_all()?.backward()
        })
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = network
}
criterion_main!(benches);
