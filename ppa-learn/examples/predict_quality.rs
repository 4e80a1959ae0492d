//! Predicts the quality of a depth image with a network, then saves and loads the weights.
//!
//! `cargo run -p ppa-learn --example predict_quality`

use std::error::Error;

use candle_core::{Device, Tensor};
use ppa_core::Roi;
use ppa_learn::data::{Raster, evaluation_input, prepare};
use ppa_learn::{EfficientNetB0, FirstConvolution, Mode, Options};

/// Columns and rows of the network's input.
const SIDE: usize = 96;

fn main() -> Result<(), Box<dyn Error>> {
    // A ridge 150 mm in front of a table at 1.2 m, in an image of 640 x 576 pixels.
    let depth_mm = (0..640 * 576)
        .map(|pixel: i32| 1200 - 150_u16.saturating_sub((pixel % 640 - 320).unsigned_abs() as u16));
    let image = Raster::new(640, 576, depth_mm.collect())?;
    let roi = Roi {
        x_start: 150,
        y_start: 120,
        size: 340,
    };
    let seen = evaluation_input(&prepare(&image, roi, false, SIDE)?, SIDE);
    let images = Tensor::from_vec(seen.into_values(), (1, 1, SIDE, SIDE), &Device::Cpu)?;

    let network = EfficientNetB0::new(7, Options::default())?;
    let quality = network.forward(&images, Mode::Eval)?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("weights.safetensors");
    network.save(&path)?;
    let other = EfficientNetB0::new(8, Options::default())?;
    other.load(&path, FirstConvolution::default())?;
    let again = other.forward(&images, Mode::Eval)?;
    println!(
        "untrained: {:?}, from its file: {:?}",
        quality.to_vec2::<f32>()?,
        again.to_vec2::<f32>()?
    );
    Ok(())
}
