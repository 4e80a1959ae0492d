//! Signals and standard errors from the tallies of a radiograph.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers, read};

/// The tallies of a radiograph cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{} holds no tallies of a radiograph: {message}", path.display())]
pub struct TalliesError {
    path: PathBuf,
    message: String,
}

/// Readings and their standard errors, row-major, eV/cm² per history.
pub(super) struct Tallies {
    pub value: Vec<f32>,
    pub sigma: Vec<f32>,
}

impl Tallies {
    /// Reads the total and the errors of all layers, taken as independent.
    pub fn read(path: &Path, pixels: [u32; 2]) -> Result<Self, TalliesError> {
        let wrong = |message: String| TalliesError {
            path: path.to_owned(),
            message,
        };
        let file = ppa_core::regular_file::open(path).map_err(|error| wrong(error.to_string()))?;
        let layer = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(BufReader::new(file))
            .map_err(|error| wrong(error.to_string()))?
            .layer_data;
        let found = [layer.size.x(), layer.size.y()];
        if found != pixels.map(|n| n as usize) {
            return Err(wrong(format!(
                "{} x {} pixels, expected {} x {}",
                found[0], found[1], pixels[0], pixels[1]
            )));
        }
        let mut value = None;
        let mut variance = vec![0.0_f32; found[0] * found[1]];
        for channel in &layer.channel_data.list {
            let name = channel.name.to_string();
            let samples = channel.sample_data.values_as_f32();
            if name == "Y" {
                value = Some(samples.collect());
            } else if name.ends_with(".sigma") {
                for (variance, sigma) in variance.iter_mut().zip(samples) {
                    *variance += sigma * sigma;
                }
            }
        }
        Ok(Self {
            value: value.ok_or_else(|| wrong("no channel Y".to_owned()))?,
            sigma: variance.into_iter().map(f32::sqrt).collect(),
        })
    }
}
