//! Images per second of training, inference or loading: `speed train|infer|load|augment THREADS BATCH SIZE STEPS [DEVICE]`.
//!
//! DEVICE is where `train` and `infer` compute, `cpu` by default; reading the loss makes each step on a device wait for the one before.
//!
//! `load` makes training batches with the paper's augmentation from depth images of 640 x 576 pixels, read from disk each time;
//! `augment` uses images that are already in memory. For both, THREADS is the number of loader threads.
//!
//! Prints one JSON object with the images and the wall and processor seconds after one warm-up step, for comparison with other programs.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use candle_core::Tensor;
use cpu_time::ProcessTime;
use ppa_core::Roi;
use ppa_dataset::layout::{LimbId, Side, View};
use ppa_learn::data::{Augmentation, Balanced, Images, Loader, Order, Sample, SampleImage};
use ppa_learn::train::Adam;
use ppa_learn::{
    DeviceName, EfficientNetB0, InferenceNetwork, Mode, Options, QualityNetwork, Targets,
};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [what, numbers @ ..] = &arguments[..] else {
        anyhow::bail!(
            "expected train, infer, load or augment, then threads, batch, size and steps"
        );
    };
    let (device, numbers) = match numbers {
        [numbers @ .., device] if numbers.len() == 4 => (device.parse()?, numbers),
        _ => (DeviceName::Cpu, numbers),
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
    if let "load" | "augment" = what.as_str() {
        let keep_bytes = if what == "load" { 0 } else { usize::MAX };
        return load(threads, batch, size, steps, keep_bytes);
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;

    let values: Vec<f32> = (0..batch * size * size)
        .map(|i| ((i % 8191) as f32 * 0.37).sin())
        .collect();
    let device = device.open()?;
    let images = Tensor::from_vec(values, (batch, 1, size, size), &device)?;
    let targets: Vec<f32> = (0..batch)
        .map(|i| 1.0 + 2.0 * i as f32 / batch as f32)
        .collect();
    let targets = Tensor::from_vec(targets, (batch, 1), &device)?;
    let network = EfficientNetB0::new(0, Options::default())?.to_device(&device)?;
    let quality = QualityNetwork::new(0, Options::default(), None, Targets::Quality)?;
    let inference = InferenceNetwork::new(&quality.to_device(&device)?)?;
    let variables = network.variables();
    let mut adam = Adam::new(&variables)?;

    let mut step = |number: usize| -> anyhow::Result<f32> {
        if what == "infer" {
            let output = inference.forward(std::slice::from_ref(&images))?;
            return Ok(output.sum_all()?.to_scalar()?);
        }
        let outputs = network.forward(
            &images,
            Mode::Train {
                step: number as u64,
            },
        )?;
        let loss = (outputs - &targets)?.sqr()?.mean_all()?;
        adam.step(&variables, &loss.backward()?, 1e-3)?;
        Ok(loss.to_scalar()?)
    };
    let first = step(0)?;
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let mut last = first;
    for number in 1..=steps {
        last = step(number)?;
    }
    let (wall_s, cpu_s) = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
    report(batch * steps, (wall_s, cpu_s), f64::from(last))
}

fn report(images: usize, (wall_s, cpu_s): (f64, f64), last: f64) -> anyhow::Result<()> {
    let peak_gib = peak_gib().context("reading the peak memory")?;
    println!(
        "{{\"images\": {images}, \"wall_s\": {wall_s:.3}, \"cpu_s\": {cpu_s:.3}, \"images_per_cpu_s\": {:.3}, \"peak_gib\": {peak_gib:.2}, \"last\": {last}}}",
        images as f64 / cpu_s
    );
    Ok(())
}

/// Depth images of a limb-like ridge in front of a tilted table, with noise of a few mm.
fn depth_images(folder: &Path, count: u32) -> anyhow::Result<Vec<Sample>> {
    let mut samples = Vec::new();
    for number in 0..count {
        let path = folder.join(format!("{number}.png"));
        let depth = |x: u32, y: u32| {
            let across = (f64::from(x) - 320.0 - f64::from(number)) / 60.0;
            let ridge = 120.0 * (1.0 - across * across).max(0.0).sqrt();
            let noise = (x * 7919 + y * 104_729 + number * 31).wrapping_mul(2_654_435_761) >> 29;
            image::Luma([(1100.0 - 0.1 * f64::from(y) - ridge) as u16 + noise as u16])
        };
        image::ImageBuffer::from_fn(640, 576, depth).save(&path)?;
        samples.push(Sample {
            id: number.to_string(),
            images: vec![SampleImage {
                path,
                camera: View::Left,
                roi: Roi {
                    x_start: 150,
                    y_start: 120,
                    size: 340,
                },
                size: [640, 576],
                mirrored: false,
            }],
            label: 1.0 + 2.0 * f64::from(number) / f64::from(count),
            label_std: 0.0,
            dataset: folder.to_owned(),
            limb: LimbId {
                patient: number,
                side: Side::Left,
            },
            camera: View::Left,
            pose: number.to_string(),
            frame: 0,
            angle_deg: None,
            correction_deg: None,
        });
    }
    Ok(samples)
}

fn load(
    workers: usize,
    batch: usize,
    size: usize,
    steps: usize,
    keep_bytes: usize,
) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let images = Images::new(depth_images(folder.path(), 64)?, size, keep_bytes)?;
    let number = |n: usize| NonZeroUsize::new(n).context("expected at least 1 worker and image");
    for sample in 0..images.samples().len() {
        images.get(sample)?; // Reads the images to be kept before the clock starts.
    }
    let order = Order::Training {
        balanced: Balanced::new(images.samples())?,
        augmentation: Some(Augmentation::default()),
        seed: 1,
        first_batch: 0,
    };
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let mut last = 0.0;
    for made in Loader::new(&Arc::new(images), &order, number(batch)?, number(workers)?).take(steps)
    {
        last = f64::from(made?.images[0][0]);
    }
    let seconds = (wall.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64());
    report(batch * steps, seconds, last)
}

/// Peak resident memory in GiB, as Linux reports it.
fn peak_gib() -> anyhow::Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .context("no VmHWM")?;
    let kib: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
    Ok(kib / f64::from(1 << 20))
}
