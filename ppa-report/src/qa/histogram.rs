//! Depths in the regions of interest.

use ppa_dataset::manifest::RoiRow;
use ppa_dataset::published::GrayImage16;

use crate::chart::{Mark, Series};

/// Width of a bin, mm.
const BIN_MM: u16 = 10;

/// Counts of depths, by bins of [`BIN_MM`].
#[derive(Default)]
pub(super) struct Depths {
    counts: Vec<u64>,
    invalid: u64,
}

impl Depths {
    /// Adds the pixels of a region, or of the whole image if there is none.
    pub fn add(&mut self, image: &GrayImage16, roi: Option<&RoiRow>) {
        let [columns, rows] = match roi {
            None => [0..image.width, 0..image.height],
            Some(roi) => [
                roi.x_start..roi.x_start.saturating_add(roi.size).min(image.width),
                roi.y_start..roi.y_start.saturating_add(roi.size).min(image.height),
            ],
        };
        for y in rows {
            for x in columns.clone() {
                match image.pixels[(y * image.width + x) as usize] {
                    0 => self.invalid += 1,
                    z_mm => {
                        let bin = usize::from(z_mm / BIN_MM);
                        self.counts.resize(self.counts.len().max(bin + 1), 0);
                        self.counts[bin] += 1;
                    }
                }
            }
        }
    }

    /// Share of pixels without depth.
    pub fn invalid_share(&self) -> f64 {
        let all = self.counts.iter().sum::<u64>() + self.invalid;
        self.invalid as f64 / all.max(1) as f64
    }

    /// Share of the valid pixels per bin, in percent, from the first to the last non-empty bin.
    pub fn series(&self, name: &str) -> Series {
        let valid = self.counts.iter().sum::<u64>().max(1) as f64;
        let first = self.counts.iter().position(|&count| count > 0).unwrap_or(0);
        let bins = self.counts.iter().enumerate().skip(first);
        let points = bins.map(|(bin, &count)| {
            let middle_mm = (bin as f64 + 0.5) * f64::from(BIN_MM);
            [middle_mm, 100.0 * count as f64 / valid]
        });
        Series::new(name, Mark::Line, points.collect())
    }
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::View;

    use super::*;

    #[test]
    fn only_the_region_counts() {
        let pixels = (0..100)
            .map(|i| if i % 10 == 4 { 0 } else { 905 + i / 10 })
            .collect();
        let image = GrayImage16 {
            width: 10,
            height: 10,
            pixels,
        };
        let roi = RoiRow {
            camera: View::Left,
            image_number: 0,
            x_start: 4,
            y_start: 3,
            size: 4,
        };
        let mut depths = Depths::default();
        depths.add(&image, Some(&roi));
        assert_eq!(depths.invalid_share(), 0.25);
        // Rows 3 and 4 are 908 and 909 mm, 5 and 6 are 910 and 911 mm.
        assert_eq!(depths.series("left").points, [[905.0, 50.0], [915.0, 50.0]]);
    }
}
