//! Images per second of training or inference: `speed train|infer THREADS BATCH SIZE STEPS`.
//!
//! Prints one JSON object with the images, wall and processor seconds after one step to warm up, for benches beside other programs.

use std::time::Instant;

use anyhow::Context;
use candle_core::{Device, Tensor};
use candle_nn::{AdamW, Optimizer, ParamsAdamW};
use cpu_time::ProcessTime;
use ppa_learn::{EfficientNetB0, Mode, Options};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [what, numbers @ ..] = &arguments[..] else {
        anyhow::bail!("expected train or infer, then threads, batch, size and steps");
    };
    let numbers: Vec<usize> = numbers
        .iter()
        .map(|n| n.parse())
        .collect::<Result<_, _>>()?;
    let &[threads, batch, size, steps] = &numbers[..] else {
        anyhow::bail!(
            "expected threads, batch, size and steps, found {} numbers",
            numbers.len()
        );
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;

    let values: Vec<f32> = (0..batch * size * size)
        .map(|i| ((i % 8191) as f32 * 0.37).sin())
        .collect();
    let images = Tensor::from_vec(values, (batch, 1, size, size), &Device::Cpu)?;
    let targets: Vec<f32> = (0..batch)
        .map(|i| 1.0 + 2.0 * i as f32 / batch as f32)
        .collect();
    let targets = Tensor::from_vec(targets, (batch, 1), &Device::Cpu)?;
    let network = EfficientNetB0::new(0, Options::default())?;
    let variables = network.variables().into_iter().cloned().collect();
    let mut adam = AdamW::new(
        variables,
        ParamsAdamW {
            lr: 1e-3,
            weight_decay: 0.0,
            ..Default::default()
        },
    )?;

    let mut step = |number: usize| -> anyhow::Result<f32> {
        if what == "infer" {
            return Ok(network
                .forward(&images, Mode::Eval)?
                .sum_all()?
                .to_scalar()?);
        }
        let outputs = network.forward(
            &images,
            Mode::Train {
                step: number as u64,
            },
        )?;
        let loss = (outputs - &targets)?.sqr()?.mean_all()?;
        adam.backward_step(&loss)?;
        Ok(loss.to_scalar()?)
    };
    let first = step(0)?;
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let mut last = first;
    for number in 1..=steps {
        last = step(number)?;
    }
    let (wall_s, cpu_s) = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
    let images = batch * steps;
    let peak_gib = peak_gib().context("reading the peak memory")?;
    println!(
        "{{\"images\": {images}, \"wall_s\": {wall_s:.3}, \"cpu_s\": {cpu_s:.3}, \"images_per_cpu_s\": {:.3}, \"peak_gib\": {peak_gib:.2}, \"last\": {last}}}",
        images as f64 / cpu_s
    );
    Ok(())
}

/// Peak resident memory, from Linux.
fn peak_gib() -> anyhow::Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .context("no VmHWM")?;
    let kib: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
    Ok(kib / f64::from(1 << 20))
}
