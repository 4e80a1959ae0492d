//! The six augmentations used in training.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::random::{Purpose, stream};

use super::blur::box_blur;
use super::lost_pixels::lose_edge_pixels;
use super::prepare::{network_value, prepared_side, share_of_range};
use super::raster::Raster;
use super::rotate::rotate;

/// Sides of the box filter.
const BLUR_SIDES: [usize; 3] = [3, 5, 7];
/// Augmentation of training images, in this order: mirroring, rotation, noise, blur, removal of pixels at depth edges, and cropping to a
/// square whose side is between that of the network's input and that of the prepared image. The default is the paper's.
///
/// The semantics are those of albumentations 1.3.1 as used in the authors' repository; noise and blur also change invalid pixels.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Augmentation {
    /// Probability of mirroring left to right.
    pub flip_probability: f64,
    /// Probability of rotation.
    pub rotate_probability: f64,
    /// Largest rotation angle in degrees in either direction; angles are uniformly distributed.
    pub rotate_limit_deg: f64,
    /// Probability of noise.
    pub noise_probability: f64,
    /// Largest variance of the Gaussian noise, as a share of the range squared; variances are uniformly distributed.
    pub noise_max_variance: f64,
    /// Probability of blurring with a box filter of side 3, 5 or 7.
    pub blur_probability: f64,
    /// Probability of making pixels at depth edges invalid.
    pub invalid_probability: f64,
}

impl Default for Augmentation {
    fn default() -> Self {
        Self {
            flip_probability: 0.5,
            rotate_probability: 0.5,
            rotate_limit_deg: 15.0,
            noise_probability: 0.5,
            noise_max_variance: 0.001,
            blur_probability: 0.7,
            invalid_probability: 0.7,
        }
    }
}

impl Augmentation {
    /// Augments the prepared images (mm) of the cameras of one pose and returns network inputs of `side * side` values each.
    ///
    /// All cameras get the same changes, including the noise, except that each loses different pixels. `seed` and `index` select the
    /// random numbers: equal values give equal images.
    ///
    /// # Panics
    /// If the side of an image is not [`prepared_side`], `side` is less than 6, or a probability is not in [0, 1].
    pub fn apply(
        &self,
        prepared_mm: &[&Raster<u16>],
        side: usize,
        seed: u64,
        index: u64,
    ) -> Vec<Raster<f32>> {
        let mut random = stream(seed, Purpose::Augmentation, index);
        let change = self.draw(side, &mut random);
        prepared_mm
            .iter()
            .map(|image| change.of(image, side, &mut random))
            .collect()
    }

    fn draw(&self, side: usize, random: &mut ChaCha8Rng) -> Change {
        let prepared = prepared_side(side);
        let flip = random.random_bool(self.flip_probability);
        let limit = self.rotate_limit_deg;
        let turn = random.random_bool(self.rotate_probability);
        let turn_deg = turn.then(|| random.random_range(-limit..=limit));
        let noise = random.random_bool(self.noise_probability).then(|| {
            let sigma = random.random_range(0.0..=self.noise_max_variance).sqrt() as f32;
            let normal = StandardNormal.sample_iter(&mut *random);
            normal
                .map(|number: f32| sigma * number)
                .take(prepared * prepared)
                .collect()
        });
        let blur = random.random_bool(self.blur_probability);
        let blur_side = blur.then(|| BLUR_SIDES[random.random_range(0..BLUR_SIDES.len())]);
        let lose = random.random_bool(self.invalid_probability);
        let crop_side = random.random_range(side..=prepared);
        let mut corner = || random.random_range(0..=prepared - crop_side);
        Change {
            flip,
            turn_deg,
            noise,
            blur_side,
            lose,
            crop_side,
            crop_corner: [corner(), corner()],
        }
    }
}

/// Parameters drawn for one sample.
struct Change {
    flip: bool,
    turn_deg: Option<f64>,
    noise: Option<Vec<f32>>,
    blur_side: Option<usize>,
    lose: bool,
    crop_side: usize,
    crop_corner: [usize; 2],
}

impl Change {
    fn of(&self, prepared_mm: &Raster<u16>, side: usize, random: &mut ChaCha8Rng) -> Raster<f32> {
        let prepared = prepared_side(side);
        assert_eq!(
            (prepared_mm.width(), prepared_mm.height()),
            (prepared, prepared),
            "images are prepared before they are augmented"
        );
        let mut image = share_of_range(prepared_mm);
        if self.flip {
            image = image.mirrored();
        }
        if let Some(degrees) = self.turn_deg {
            image = rotate(&image, degrees);
        }
        if let Some(noise) = &self.noise {
            for (value, noise) in image.values_mut().iter_mut().zip(noise) {
                *value = (*value + noise).clamp(0.0, 1.0);
            }
        }
        if let Some(side) = self.blur_side {
            image = box_blur(&image, side);
        }
        if self.lose {
            lose_edge_pixels(&mut image, random);
        }
        let [x, y] = self.crop_corner;
        let square = image.crop(x, y, self.crop_side, self.crop_side);
        let square = square.expect("the square was drawn within the image");
        square.resized(side, side).map(network_value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 30;
    const DRAWS: u64 = 4000;

    fn draws() -> Vec<Change> {
        let draw = |index| {
            Augmentation::default().draw(SIDE, &mut stream(1, Purpose::Augmentation, index))
        };
        (0..DRAWS).map(draw).collect()
    }

    /// Deviation of the mean of `numbers` from `mean`, in standard errors, if each number has this variance.
    fn z(numbers: &[f64], mean: f64, variance: f64) -> f64 {
        let n = numbers.len() as f64;
        (numbers.iter().sum::<f64>() / n - mean) / (variance / n).sqrt()
    }

    #[test]
    fn augmentations_have_the_frequencies_of_the_paper() {
        let draws = draws();
        let rate = |happened: fn(&Change) -> bool, p: f64| {
            let numbers: Vec<f64> = draws.iter().map(|d| f64::from(happened(d))).collect();
            z(&numbers, p, p * (1.0 - p))
        };
        let angles: Vec<f64> = draws.iter().filter_map(|d| d.turn_deg).collect();
        assert!(angles.iter().all(|angle| angle.abs() <= 15.0));
        let squares: Vec<f64> = angles.iter().map(|angle| angle * angle).collect();
        // Variance of the noise per image, uniform on [0, 10⁻³]; its estimate from 36² pixels has a relative variance of 2/36².
        let variances: Vec<f64> = draws
            .iter()
            .filter_map(|d| d.noise.as_ref())
            .map(|noise| {
                let squares = noise.iter().map(|&x| f64::from(x).powi(2));
                squares.sum::<f64>() / noise.len() as f64
            })
            .collect();
        let spread = 1e-6 / 12.0 + 2.0 / 1296.0 * 1e-6 / 3.0;
        let blurred = |side: usize| {
            let of_blurred = draws.iter().filter_map(|d| d.blur_side);
            let numbers: Vec<f64> = of_blurred.map(|s| f64::from(s == side)).collect();
            z(&numbers, 1.0 / 3.0, 2.0 / 9.0)
        };
        let corners: Vec<f64> = draws
            .iter()
            .filter(|d| d.crop_side < 36)
            .flat_map(|d| {
                d.crop_corner
                    .map(|at| at as f64 / (36 - d.crop_side) as f64)
            })
            .collect();
        let found = [
            ("flip", rate(|d| d.flip, 0.5)),
            ("turn", rate(|d| d.turn_deg.is_some(), 0.5)),
            ("noise", rate(|d| d.noise.is_some(), 0.5)),
            ("blur", rate(|d| d.blur_side.is_some(), 0.7)),
            ("lost pixels", rate(|d| d.lose, 0.7)),
            ("angle", z(&angles, 0.0, 75.0)),
            (
                "angle squared",
                z(&squares, 75.0, 4.0 / 45.0 * 15f64.powi(4)),
            ),
            ("variance", z(&variances, 5e-4, spread)),
            ("side 3", blurred(3)),
            ("side 5", blurred(5)),
            ("side 7", blurred(7)),
            // Uniform on m + 1 places between 0 and 1: variance (m + 2) / 12 m, at most 1/4.
            ("corner", z(&corners, 0.5, 0.25)),
        ];
        for (what, z) in found {
            assert!(z.abs() < 4.0, "{what}: {z:.1} standard errors"); // 6e-5 each
        }
    }

    #[test]
    fn squares_have_all_sides_and_places_evenly() {
        let draws = draws();
        let mut sides = [0.0; 7];
        let mut places = [0.0; 7];
        for draw in &draws {
            sides[draw.crop_side - SIDE] += 1.0;
            if draw.crop_side == SIDE {
                places[draw.crop_corner[0]] += 1.0;
            }
        }
        for counts in [sides, places] {
            let expected = counts.iter().sum::<f64>() / 7.0;
            let chi2: f64 = counts
                .iter()
                .map(|n| (n - expected).powi(2) / expected)
                .sum();
            assert!(chi2 < 27.9, "{counts:?}: chi squared {chi2:.1}"); // 1e-4 for 6 degrees of freedom
        }
    }

    #[test]
    fn cameras_are_changed_alike_but_lose_pixels_of_their_own() {
        let depth = |i: usize| 500 + (i * i % 811) as u16;
        let image = Raster::new(120, 120, (0..120 * 120).map(depth).collect()).unwrap();
        let pair = |invalid_probability, index| {
            let augmentation = Augmentation {
                invalid_probability,
                ..Augmentation::default()
            };
            augmentation.apply(&[&image, &image], 100, 3, index)
        };
        let mut apart = 0;
        for index in 0..20 {
            let [first, second] = &pair(0.0, index)[..] else {
                panic!("two images")
            };
            assert_eq!(first, second);
            let [first, second] = &pair(1.0, index)[..] else {
                panic!("two images")
            };
            let pixels = first.values().iter().zip(second.values());
            for (a, b) in pixels.filter(|(a, b)| a != b) {
                assert!(*a == -0.5 || *b == -0.5);
                apart += 1;
            }
        }
        assert!(apart > 0);
    }

    #[test]
    fn images_follow_from_seed_and_index() {
        let image = Raster::new(36, 36, (0..1296).collect()).unwrap();
        let augmented = |seed, index| Augmentation::default().apply(&[&image], SIDE, seed, index);
        assert_eq!(augmented(1, 7), augmented(1, 7));
        assert_ne!(augmented(1, 7), augmented(1, 8));
        assert_ne!(augmented(1, 7), augmented(2, 7));
    }
}
