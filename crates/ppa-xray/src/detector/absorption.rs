//! Energy that a photon leaves in a converter layer: its mean and its mean square.

use std::f64::consts::TAU;

use crate::detector::energy_nodes::EnergyNodes;
use crate::detector::receptor::{DetectorModel, ReceptorError, require};
use crate::matter::cross_sections::ELECTRON_REST_KEV;
use crate::matter::klein_nishina::energy_ratio;
use crate::matter::material::Material;
use crate::transport::tally::Moments;

/// Density of a CsI crystal and of amorphous selenium, g/cm³.
const CSI_G_CM3: f64 = 4.51;
const SELENIUM_G_CM3: f64 = 4.27;

/// Intervals between grazing (cosine 0) and normal (cosine 1) incidence.
const COSINES: usize = 16;

/// Points of the integrals over depth, and over polar angle and azimuth of Compton scattering.
const DEPTHS: usize = 12;
const POLAR: usize = 10;
const AZIMUTHS: usize = 6;

/// Response of a homogeneous layer by energy and incidence.
///
/// A photon interacts at a depth that Beer–Lambert gives and leaves its energy there, but for a K x-ray or a Compton
/// photon that gets out. Where one of these interacts again, its energy stays but for a K x-ray in turn, whose way
/// out is taken from the depth of the first interaction. Rayleigh scattering does not stop a photon and is left out
/// of the attenuation.
#[derive(Debug, Clone)]
pub(crate) struct Absorption {
    nodes: EnergyNodes,
    /// ⟨ε⟩/E and ⟨ε²⟩/E², by energy node and by cosine.
    shares: Vec<[[f64; 2]; COSINES + 1]>,
}

/// A homogeneous layer.
struct Layer {
    material: Material,
    g_cm2: f64,
}

/// Optical thickness of the layer at one energy, normal incidence.
struct Thickness {
    photoelectric: f64,
    compton: f64,
}

impl Absorption {
    /// None for the ideal detector, which keeps everything.
    ///
    /// # Errors
    /// [`ReceptorError`] naming a thickness or packing out of range.
    pub fn of(model: &DetectorModel) -> Result<Option<Self>, ReceptorError> {
        let layer = match *model {
            DetectorModel::Ideal => return Ok(None),
            DetectorModel::Csi {
                thickness_um,
                packing,
            } => {
                check_thickness(thickness_um)?;
                let expected = "above 0, up to 1";
                require(
                    "the packing of the CsI layer",
                    packing,
                    1e-3..=1.0,
                    expected,
                )?;
                Layer::new("csi", CSI_G_CM3 * packing * thickness_um)
            }
            DetectorModel::Selenium { thickness_um } => {
                check_thickness(thickness_um)?;
                Layer::new("selenium", SELENIUM_G_CM3 * thickness_um)
            }
        };
        Ok(Some(Self::of_layer(&layer)))
    }

    fn of_layer(layer: &Layer) -> Self {
        let nodes = EnergyNodes::with_edges(layer.material.edges_kev());
        let depths = gauss_legendre::<DEPTHS>();
        let shares = nodes
            .kev()
            .iter()
            .map(|&energy_kev| {
                let response = LayerResponse::new(layer, energy_kev);
                std::array::from_fn(|i| response.at((i as f64 / COSINES as f64).max(1e-3), &depths))
            })
            .collect();
        Self { nodes, shares }
    }

    /// Incidence cosines of the table, ascending.
    pub fn cosines() -> impl Iterator<Item = f64> {
        (0..=COSINES).map(|i| i as f64 / COSINES as f64)
    }

    /// Interval of [`Absorption::cosines`] that holds a cosine, and how far into it the cosine lies.
    #[inline]
    pub fn column(cos: f64) -> (usize, f64) {
        let at = cos.clamp(0.0, 1.0) * COSINES as f64;
        let column = (at as usize).min(COSINES - 1);
        (column, at - column as f64)
    }

    /// Moments of the energy left by a photon that comes in at `cos` to the normal.
    #[inline]
    pub fn moments(&self, energy_kev: f64, cos: f64) -> Moments {
        let (node, t) = self.nodes.locate(energy_kev);
        let (column, s) = Self::column(cos);
        let share = |moment: usize| {
            let row = |node: usize| {
                let row = &self.shares[node];
                row[column][moment] + s * (row[column + 1][moment] - row[column][moment])
            };
            row(node) + t * (row(node + 1) - row(node))
        };
        Moments {
            mean_kev: share(0) * energy_kev,
            square_kev2: share(1) * energy_kev * energy_kev,
        }
    }
}

fn check_thickness(thickness_um: f64) -> Result<(), ReceptorError> {
    let what = "the thickness of the detector layer in µm";
    require(what, thickness_um, 1.0..=1e5, "1 to 100000")
}

impl Layer {
    /// A layer of a material of the library, by density in g/cm³ times thickness in µm.
    fn new(material: &str, g_cm3_um: f64) -> Self {
        Self {
            material: Material::named(material).expect("in the library"),
            g_cm2: 1e-4 * g_cm3_um,
        }
    }

    fn thickness(&self, energy_kev: f64) -> Thickness {
        let sections = self.material.cross_sections_unchecked(energy_kev);
        Thickness {
            photoelectric: sections.photoelectric * self.g_cm2,
            compton: sections.compton * self.g_cm2,
        }
    }
}

impl Thickness {
    fn total(&self) -> f64 {
        self.photoelectric + self.compton
    }
}

/// Ways to lose energy from the layer, for photons of one energy.
struct LayerResponse {
    energy_kev: f64,
    thickness: f64,
    k_rays: Vec<KRay>,
    scattered: Vec<Scattered>,
    /// K x-rays where scattered photons, of their mean energy, interact again.
    k_rays_of_scattered: Vec<KRay>,
}

/// A K x-ray, sent out evenly in all directions.
struct KRay {
    /// Per interaction of the photon it comes from.
    probability: f64,
    energy_kev: f64,
    /// Optical thickness of the layer for it.
    thickness: f64,
    /// K x-rays of lighter elements where it interacts again.
    next: Vec<KRay>,
}

/// Compton scattering by one angle.
struct Scattered {
    /// Per interaction.
    probability: f64,
    cos: f64,
    energy_kev: f64,
    /// Optical thickness of the layer for the scattered photon.
    thickness: f64,
}

impl KRay {
    /// K x-rays per interaction of photons of one energy.
    fn of_photons(layer: &Layer, energy_kev: f64) -> Vec<Self> {
        let at = layer.thickness(energy_kev);
        let lines = layer.material.k_fluorescence(energy_kev).into_iter();
        lines
            .map(|line| Self {
                probability: at.photoelectric / at.total() * line.probability,
                energy_kev: line.energy_kev,
                thickness: layer.thickness(line.energy_kev).total(),
                next: Self::of_photons(layer, line.energy_kev),
            })
            .collect()
    }

    /// Probability to get out from a depth (share of the layer).
    fn escape(&self, depth: f64) -> f64 {
        0.5 * (e2(self.thickness * depth) + e2(self.thickness * (1.0 - depth)))
    }
}

/// What gets away, relative to the photon that came in.
#[derive(Default)]
struct Loss {
    energy: f64,
    /// 1 − ⟨ε²⟩/E².
    square: f64,
}

impl Loss {
    /// A share of the energy gets away with a probability and leaves the rest.
    fn add(&mut self, probability: f64, share: f64) {
        self.energy += probability * share;
        self.square += probability * share * (2.0 - share);
    }

    /// K x-rays set free at a depth get away, or those that follow them.
    fn add_k_rays(&mut self, probability: f64, rays: &[KRay], depth: f64, incident_kev: f64) {
        for ray in rays {
            let sent = probability * ray.probability;
            let out = ray.escape(depth);
            self.add(sent * out, ray.energy_kev / incident_kev);
            self.add_k_rays(sent * (1.0 - out), &ray.next, depth, incident_kev);
        }
    }
}

impl LayerResponse {
    fn new(layer: &Layer, energy_kev: f64) -> Self {
        let at = layer.thickness(energy_kev);
        let alpha = energy_kev / ELECTRON_REST_KEV;
        // Klein and Nishina per solid angle.
        let angles = gauss_legendre::<POLAR>().map(|(x, weight)| {
            let cos = 2.0 * x - 1.0;
            let ratio = energy_ratio(alpha, cos);
            let density = ratio * ratio * (ratio + 1.0 / ratio - 1.0 + cos * cos);
            (weight * density, cos, ratio * energy_kev)
        });
        let sum: f64 = angles.iter().map(|(weight, ..)| weight).sum();
        let scattered = angles.map(|(weight, cos, energy_kev)| Scattered {
            probability: at.compton / at.total() * weight / sum,
            cos,
            energy_kev,
            thickness: layer.thickness(energy_kev).total(),
        });
        let mean_kev: f64 = angles
            .iter()
            .map(|(weight, _, kev)| weight * kev)
            .sum::<f64>()
            / sum;
        Self {
            energy_kev,
            thickness: at.total(),
            k_rays: KRay::of_photons(layer, energy_kev),
            scattered: scattered.into(),
            k_rays_of_scattered: KRay::of_photons(layer, mean_kev),
        }
    }

    /// ⟨ε⟩/E and ⟨ε²⟩/E² at incidence `cos`; `depths` integrates over [0, 1].
    fn at(&self, cos: f64, depths: &[(f64, f64)]) -> [f64; 2] {
        let slant = self.thickness / cos;
        let interacts = -(-slant).exp_m1();
        let mut loss = Loss::default();
        for &(x, weight) in depths {
            // Share of the layer above the interaction.
            let depth = (-(-x * interacts).ln_1p() / slant).clamp(0.0, 1.0);
            loss.add_k_rays(weight, &self.k_rays, depth, self.energy_kev);
            let mut stays = 0.0;
            for scattered in &self.scattered {
                let out = scattered.escape(depth, cos);
                stays += weight * scattered.probability * (1.0 - out);
                let share = scattered.energy_kev / self.energy_kev;
                loss.add(weight * scattered.probability * out, share);
            }
            loss.add_k_rays(stays, &self.k_rays_of_scattered, depth, self.energy_kev);
        }
        [
            interacts * (1.0 - loss.energy),
            interacts * (1.0 - loss.square),
        ]
    }
}

impl Scattered {
    /// Probability to get out from a depth after incidence at `cos`, mean over the azimuth.
    fn escape(&self, depth: f64, cos: f64) -> f64 {
        let sines = (1.0 - cos * cos).sqrt() * (1.0 - self.cos * self.cos).sqrt();
        let out = (0..AZIMUTHS).map(|azimuth| {
            let phi = TAU * (azimuth as f64 + 0.5) / AZIMUTHS as f64;
            let down = cos * self.cos + sines * phi.cos();
            let way = if down > 0.0 { 1.0 - depth } else { depth };
            (-self.thickness * way / down.abs().max(1e-9)).exp()
        });
        out.sum::<f64>() / AZIMUTHS as f64
    }
}

/// Exponential integral E₂(x) = ∫₀¹ exp(−x/c) dc: the share of isotropic photons that get through an optical
/// depth x of a half-space (Abramowitz and Stegun, 5.1.4, 5.1.11, 5.1.14, 5.1.22).
fn e2(x: f64) -> f64 {
    const EULER: f64 = 0.577_215_664_901_532_9;
    if x <= 0.0 {
        return 1.0;
    }
    if x > 700.0 {
        return 0.0;
    }
    let e1 = if x < 1.0 {
        let mut sum = -EULER - x.ln();
        let mut term = -1.0;
        for n in 1..30 {
            term *= -x / f64::from(n);
            sum += term / f64::from(n);
        }
        sum
    } else {
        // Lentz's continued fraction.
        let mut b = x + 1.0;
        let mut c = f64::INFINITY;
        let mut d = 1.0 / b;
        let mut fraction = d;
        for n in 1..200 {
            let a = -f64::from(n * n);
            b += 2.0;
            d = 1.0 / (a * d + b);
            c = b + a / c;
            fraction *= c * d;
            if (c * d - 1.0).abs() < 1e-12 {
                break;
            }
        }
        fraction * (-x).exp()
    };
    (-x).exp() - x * e1
}

/// Points and weights of Gauss and Legendre on [0, 1].
fn gauss_legendre<const N: usize>() -> [(f64, f64); N] {
    std::array::from_fn(|i| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (N as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut p, mut before) = (x, 1.0);
            for n in 2..=N {
                let n = n as f64;
                (p, before) = (((2.0 * n - 1.0) * x * p - (n - 1.0) * before) / n, p);
            }
            slope = N as f64 * (x * p - before) / (x * x - 1.0);
            x -= p / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::spectrum::Spectrum;
    use crate::beam::tube::TubeSpec;
    use crate::philox::Philox;

    fn csi(thickness_um: f64) -> Absorption {
        let packing = 0.8;
        let model = DetectorModel::Csi {
            thickness_um,
            packing,
        };
        Absorption::of(&model).unwrap().unwrap()
    }

    fn selenium(thickness_um: f64) -> Absorption {
        let model = DetectorModel::Selenium { thickness_um };
        Absorption::of(&model).unwrap().unwrap()
    }

    /// E₂ of Abramowitz and Stegun, table 5.4.
    #[test]
    fn exponential_integral_agrees_with_the_tables() {
        for (x, expected) in [
            (0.0, 1.0),
            (0.1, 0.722_545_0),
            (0.5, 0.326_643_9),
            (1.0, 0.148_495_5),
            (2.0, 0.037_534_3),
        ] {
            assert!((e2(x) - expected).abs() < 2e-7, "E₂({x}) = {}", e2(x));
        }
    }

    #[test]
    fn points_and_weights_integrate_polynomials() {
        for power in 0..20 {
            let sum: f64 = gauss_legendre::<10>()
                .iter()
                .map(|(x, w)| w * x.powi(power))
                .sum();
            assert!((sum * f64::from(power + 1) - 1.0).abs() < 1e-13, "{power}");
        }
    }

    /// Below the K edges nothing of note gets out: what is left is absorption, E (1 − exp(−μ t / cos)).
    #[test]
    fn below_the_edge_a_layer_absorbs_as_beer_and_lambert_say() {
        let layer = csi(200.0);
        let thickness = Layer::new("csi", 4.51 * 0.8 * 200.0);
        for (energy_kev, cos) in [(20.0, 1.0), (33.0, 1.0), (30.0, 0.5)] {
            let expected = 1.0 - (-thickness.thickness(energy_kev).total() / cos).exp();
            let found = layer.moments(energy_kev, cos).mean_kev / energy_kev;
            assert!((found / expected - 1.0).abs() < 0.01, "{found}, {expected}");
        }
    }

    /// The tabulated layer against photons followed one by one, with flights, K x-rays and Compton scattering
    /// sampled anew (Klein–Nishina by rejection, Rayleigh left out as in the table), secondaries followed to the end.
    #[test]
    fn a_layer_leaves_what_photons_followed_one_by_one_leave() {
        for (energy_kev, cos, material, g_cm3_um, absorption) in [
            (60.0, 0.9, "csi", 4.51 * 0.8 * 600.0, csi(600.0)),
            (110.0, 1.0, "csi", 4.51 * 0.8 * 600.0, csi(600.0)),
            (25.0, 0.6, "selenium", 4.27 * 200.0, selenium(200.0)),
            (70.0, 1.0, "selenium", 4.27 * 1_000.0, selenium(1_000.0)),
        ] {
            let layer = Layer::new(material, g_cm3_um);
            let photons = 30_000;
            let (mut sum, mut square, mut fourth) = (0.0, 0.0, 0.0);
            for i in 0..photons {
                let mut rng = Philox::new(8, 0, i);
                let left = follow(&layer, energy_kev, cos, &mut rng);
                sum += left;
                square += left * left;
                fourth += left.powi(4);
            }
            let n = photons as f64;
            let table = absorption.moments(energy_kev, cos);
            let (mean, mean_square) = (sum / n, square / n);
            let error = ((mean_square - mean * mean) / n).sqrt();
            let error_square = ((fourth / n - mean_square * mean_square) / n).sqrt();
            println!(
                "{energy_kev} keV: {mean:.3} ± {error:.3}, table {:.3}; {mean_square:.1} ± {error_square:.1}, table {:.1}",
                table.mean_kev, table.square_kev2
            );
            // 4 sigma (6e-5 each), and 0.4 % for what the table simplifies: with 200 000 photons it is 0.2 to 0.4 % high.
            assert!((mean - table.mean_kev).abs() < 4.0 * error + 0.004 * mean);
            assert!(
                (mean_square - table.square_kev2).abs() < 4.0 * error_square + 0.004 * mean_square
            );
        }
    }

    /// Energy left by one photon and all it sets free.
    fn follow(layer: &Layer, energy_kev: f64, cos: f64, rng: &mut Philox) -> f64 {
        let mut left = 0.0;
        let mut flying = vec![(0.0, cos, energy_kev)];
        while let Some((depth, cos, energy_kev)) = flying.pop() {
            let at = layer.thickness(energy_kev);
            let depth = depth - (1.0 - rng.unit()).ln() * cos / at.total();
            if !(0.0..1.0).contains(&depth) {
                continue;
            }
            if rng.unit() * at.total() < at.compton {
                let alpha = energy_kev / ELECTRON_REST_KEV;
                let (theta, ratio) = loop {
                    let theta = 2.0 * rng.unit() - 1.0;
                    let ratio = energy_ratio(alpha, theta);
                    let density = ratio * ratio * (ratio + 1.0 / ratio - 1.0 + theta * theta) / 2.0;
                    if rng.unit() < density {
                        break (theta, ratio);
                    }
                };
                let phi = TAU * rng.unit();
                let sines = (1.0 - cos * cos).sqrt() * (1.0 - theta * theta).sqrt();
                left += energy_kev * (1.0 - ratio);
                let out = cos * theta + sines * phi.cos();
                flying.push((depth, out, energy_kev * ratio));
                continue;
            }
            left += energy_kev;
            let mut lot = rng.unit();
            for line in layer.material.k_fluorescence(energy_kev) {
                if lot < line.probability {
                    left -= line.energy_kev;
                    flying.push((depth, 2.0 * rng.unit() - 1.0, line.energy_kev));
                    break;
                }
                lot -= line.probability;
            }
        }
        left
    }

    /// Absorption times Swank factor of a whole beam against measured DQE at low frequency.
    ///
    /// 0.6 mm of structured CsI, 70 kV, 19 mm Al added: 78 % at 0.15/mm (Samei, Med. Phys. 30 (2003) 1747). Light that is
    /// not collected evenly costs a real layer up to a tenth more (Swank factors of 0.91 and 0.93 below the K edge, where
    /// K x-rays play no part: Zhao, Ristić, Rowlands, Med. Phys. 31 (2004) 2594), so ours must lie above.
    #[test]
    fn dqe_of_csi_is_that_of_measured_layers_but_for_their_light() {
        let filters = vec!["Al:2.5".parse().unwrap(), "Al:19".parse().unwrap()];
        let beam = Spectrum::tungsten(&TubeSpec {
            kvp: 70.0,
            anode_angle_deg: 12.0,
            filters,
        })
        .unwrap();
        let layer = csi(600.0);
        let (mut mean, mut square) = (0.0, 0.0);
        for (energy_kev, probability) in beam.bins() {
            let left = layer.moments(energy_kev, 1.0);
            mean += probability * left.mean_kev;
            square += probability * left.square_kev2;
        }
        let dqe = mean * mean / square;
        println!("DQE(0) {dqe:.3}");
        let (thin, thick) = (selenium(500.0), selenium(1_000.0));
        for energy_kev in [20.0, 30.0, 40.0, 60.0, 80.0, 100.0] {
            let of = |a: &Absorption| {
                let m = a.moments(energy_kev, 1.0);
                let dqe = m.mean_kev.powi(2) / m.square_kev2;
                (m.mean_kev / energy_kev, dqe)
            };
            println!(
                "{energy_kev} keV: CsI {:.3?}, Se 500 {:.3?}, Se 1000 {:.3?}",
                of(&layer),
                of(&thin),
                of(&thick)
            );
        }
        assert!((0.78..0.78 / 0.9).contains(&dqe), "{dqe}");
    }

    #[test]
    fn layers_that_make_no_sense_are_refused() {
        for thickness_um in [0.0, -600.0, f64::NAN, 1e9] {
            let model = DetectorModel::Selenium { thickness_um };
            let error = Absorption::of(&model).unwrap_err().to_string();
            assert!(error.contains("thickness"), "{error}");
        }
        let model = DetectorModel::Csi {
            thickness_um: 600.0,
            packing: 1.2,
        };
        let error = Absorption::of(&model).unwrap_err().to_string();
        assert!(error.contains("packing"), "{error}");
    }
}
