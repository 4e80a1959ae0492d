//! Transmission of an anti-scatter grid.

use nalgebra::Vector3;

use crate::beam::receptor::{AntiScatterGrid, LinesAlong, ReceptorError, require};
use crate::detector::energy_nodes::EnergyNodes;
use crate::detector::strip_pattern::{StripPattern, Strips};
use crate::matter::material::Material;
use crate::vector_math::exp;

/// An anti-scatter grid with its attenuation by energy.
///
/// In a frame sheared along its strips the grid is upright. A photon that crosses it moves sideways by Δ, with a uniform
/// strip phase. Δ consists of n full periods, each with one strip thickness d in lead, and a rest δ whose overlap o
/// with the strips is a trapezoidal function of the phase; the mean of exp(−κ o) over the phase has a closed form. Averaging
/// over the phase follows Day and Dance, Phys. Med. Biol. 28 (1983) 1429.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    height_mm: f64,
    strips: Strips,
    moving: bool,
    /// Inverse of the distance of the focal line, 1/mm; 0 for parallel strips.
    convergence_per_mm: f64,
    /// Axis across the strips, and the position of the grid's centre on it.
    across: usize,
    centre_mm: f64,
    nodes: EnergyNodes,
    /// Attenuation of strip and interspace, 1/mm, by energy node.
    attenuation: Vec<[f64; 2]>,
}

impl Grid {
    /// # Errors
    /// [`ReceptorError`] naming the invalid number or material.
    pub fn new(grid: &AntiScatterGrid, centre_mm: [f64; 2]) -> Result<Self, ReceptorError> {
        require("the grid ratio", grid.ratio, 0.0..=100.0, "0 to 100")?;
        let lines = "the number of grid lines per cm";
        require(lines, grid.lines_per_cm, 1.0..=1_000.0, "1 to 1000")?;
        let strip = "the thickness of the grid strips in mm";
        require(strip, grid.strip_mm, 1e-4..=10.0, "0.0001 to 10")?;
        if let Some(focus_mm) = grid.focus_mm {
            let focus = "the focal distance of the grid in mm";
            require(
                focus,
                focus_mm,
                100.0..=1e5,
                "100 to 100000, or none for parallel strips",
            )?;
        }
        let pitch_mm = 10.0 / grid.lines_per_cm;
        if grid.strip_mm >= pitch_mm {
            return Err(ReceptorError::Strips {
                strip_mm: grid.strip_mm,
                lines_per_cm: grid.lines_per_cm,
                pitch_mm,
            });
        }
        let material = |part: &'static str, name: &str| {
            Material::named(name).map_err(|error| ReceptorError::Material {
                part,
                message: error.to_string(),
            })
        };
        let strips = material("strips", &grid.strip)?;
        let spaces = material("spaces", &grid.interspace)?;
        let edges = [strips.edges_kev(), spaces.edges_kev()].concat();
        let nodes = EnergyNodes::with_edges(edges);
        let per_mm = |material: &Material, energy_kev: f64| {
            let sections = material.cross_sections_unchecked(energy_kev);
            sections.total() * material.density_g_cm3() / 10.0
        };
        let attenuation = nodes.kev().iter();
        let attenuation = attenuation
            .map(|&energy_kev| [per_mm(&strips, energy_kev), per_mm(&spaces, energy_kev)])
            .collect();
        let across = match grid.lines_along {
            LinesAlong::X => 1,
            LinesAlong::Y => 0,
        };
        Ok(Self {
            height_mm: grid.ratio * (pitch_mm - grid.strip_mm),
            strips: Strips {
                strip_mm: grid.strip_mm,
                pitch_mm,
            },
            moving: grid.moving,
            convergence_per_mm: grid.focus_mm.map_or(0.0, |focus_mm| 1.0 / focus_mm),
            across,
            centre_mm: centre_mm[across],
            nodes,
            attenuation,
        })
    }

    /// Absorption edges of strips and interspace.
    pub fn edges_kev(&self) -> &[f64] {
        self.nodes.edges_kev()
    }

    /// Attenuation of strips and interspace, 1/mm.
    #[inline]
    pub fn attenuation(&self, energy_kev: f64) -> [f64; 2] {
        let (node, t) = self.nodes.locate(energy_kev);
        let (from, to) = (&self.attenuation[node], &self.attenuation[node + 1]);
        [0, 1].map(|part| from[part] + t * (to[part] - from[part]))
    }

    /// Whether the strips move, so that only the mean over their phase matters.
    pub fn is_moving(&self) -> bool {
        self.moving
    }

    /// Device axis across the strips.
    pub fn across(&self) -> usize {
        self.across
    }

    pub fn pitch_mm(&self) -> f64 {
        self.strips.pitch_mm
    }

    /// Path length through the grid.
    pub fn way_mm(&self, direction: &Vector3<f64>) -> f64 {
        self.height_mm / direction.z
    }

    /// Movement of photons across the strips, in the frame where these are upright.
    #[inline]
    fn signed_sideways_mm(&self, at_mm: [f64; 2], direction: &Vector3<f64>) -> f64 {
        let lean = (at_mm[self.across] - self.centre_mm) * self.convergence_per_mm;
        self.height_mm * (direction[self.across] / direction.z - lean)
    }

    /// Size of the movement across the strips, with a negligible lower limit: for photons along the strips the movement is zero and the
    /// attenuation per movement infinite.
    #[inline]
    fn sideways_mm(&self, signed_mm: f64) -> f64 {
        signed_mm.abs().max(1e-9 * self.strips.pitch_mm)
    }

    /// Exit position of photons that cross the detector plane at device (x, y) and move sideways by `signed_mm`, with the direction
    /// reversed where needed so that they move to higher values; relative to the grid's centre, which is that of a strip. The grid ends
    /// at the detector plane.
    #[inline]
    fn exit_mm(&self, at_mm: [f64; 2], signed_mm: f64) -> f64 {
        at_mm[self.across] - self.centre_mm + (-signed_mm).max(0.0)
    }

    /// Probability of passing a stationary grid without interaction; attenuations in 1/mm.
    #[inline]
    pub fn transmission_in_place(
        &self,
        at_mm: [f64; 2],
        direction: &Vector3<f64>,
        [strip, space]: [f64; 2],
    ) -> f64 {
        let signed_mm = self.signed_sideways_mm(at_mm, direction);
        let sideways_mm = self.sideways_mm(signed_mm);
        let exit_mm = self.exit_mm(at_mm, signed_mm);
        let share = self.strips.in_strips_mm(exit_mm, sideways_mm) / sideways_mm;
        (-self.way_mm(direction) * (space + share * (strip - space))).exp()
    }

    /// Shadow of the strips of a stationary grid for photons that cross the plane around device (x, y) in one direction over a path of
    /// `way_mm`, and the position of those photons in it. Attenuation by the interspace is not included.
    pub fn pattern(
        &self,
        at_mm: [f64; 2],
        direction: &Vector3<f64>,
        way_mm: f64,
        [strip, space]: [f64; 2],
    ) -> (StripPattern, f64) {
        let signed_mm = self.signed_sideways_mm(at_mm, direction);
        let sideways_mm = self.sideways_mm(signed_mm);
        let kappa_per_mm = (strip - space) * way_mm / sideways_mm;
        let pattern = StripPattern::new(self.strips, sideways_mm, kappa_per_mm);
        (pattern, self.exit_mm(at_mm, signed_mm))
    }

    /// Path of photons that cross the grid at device (x, y); `direction` is a unit vector in the device frame with z > 0.
    #[inline]
    pub fn crossing(&self, at_mm: [f64; 2], direction: &Vector3<f64>) -> Crossing {
        let (d, p) = (self.strips.strip_mm, self.strips.pitch_mm);
        let sideways_mm = self.sideways_mm(self.signed_sideways_mm(at_mm, direction));
        let periods = (sideways_mm / p).floor();
        let rest = sideways_mm - periods * p;
        let least = (rest + d - p).max(0.0);
        let most = rest.min(d);
        let plateau = (rest - d).abs();
        Crossing {
            way_mm: self.way_mm(direction),
            per_sideways_mm: 1.0 / sideways_mm,
            certain_mm: periods * d + least,
            more_mm: most - least,
            plateau: plateau / p,
            gap: (p - plateau) / p - 2.0 * (most - least) / p,
            ramps: 2.0 * (most - least) / p,
        }
    }
}

/// Path lengths through the grid, in the frame where the strips are upright.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    /// Length of the path.
    way_mm: f64,
    /// Inverse of the sideways movement.
    per_sideways_mm: f64,
    /// Part of the sideways movement that is in strips at any phase.
    certain_mm: f64,
    /// Additional part in strips at the worst phase.
    more_mm: f64,
    /// Shares of the phase with the most, with the least, and in between.
    plateau: f64,
    gap: f64,
    ramps: f64,
}

impl Crossing {
    /// Probability to pass without interacting, mean over the strips' phase; attenuations in 1/mm.
    #[inline]
    pub fn transmission(&self, [strip, space]: [f64; 2]) -> f64 {
        let kappa = (strip - space) * self.way_mm * self.per_sideways_mm;
        let most = kappa * self.more_mm;
        // ⟨exp(−κ o)⟩ over a ramp from 0 to most.
        let lost = -(-most).exp_m1();
        let ramp = if most.abs() > 1e-9 { lost / most } else { 1.0 };
        let mean = self.plateau * (1.0 - lost) + self.gap + self.ramps * ramp;
        (-space * self.way_mm - kappa * self.certain_mm).exp() * mean
    }

    /// [`Crossing::transmission`] without a branch.
    #[inline(always)]
    pub fn transmission_f32(&self, strip: f32, space: f32) -> f32 {
        let kappa = (strip - space) * (self.way_mm * self.per_sideways_mm) as f32;
        let most = kappa * self.more_mm as f32;
        let lost = 1.0 - exp(-most);
        // First terms of the series where the difference loses digits.
        let series = 1.0 - most * (0.5 - most * (1.0 / 6.0 - most * (1.0 / 24.0)));
        let ramp = if most.abs() > 0.05 {
            lost / most
        } else {
            series
        };
        let mean = self.plateau as f32 * (1.0 - lost) + self.gap as f32 + self.ramps as f32 * ramp;
        exp(-space * self.way_mm as f32 - kappa * self.certain_mm as f32) * mean
    }
}

#[cfg(test)]
mod tests {
    use ppa_core::random::Philox;

    use super::*;

    fn clinical() -> AntiScatterGrid {
        AntiScatterGrid {
            focus_mm: Some(1_100.0),
            ..AntiScatterGrid::new(10.0, 40.0)
        }
    }

    fn transmission(grid: &Grid, energy_kev: f64, x_mm: f64, direction: Vector3<f64>) -> f64 {
        let crossing = grid.crossing([x_mm, 0.0], &direction.normalize());
        crossing.transmission(grid.attenuation(energy_kev))
    }

    /// Rays marched through strips and spaces at random phases, with geometry and attenuation by code of this test.
    #[test]
    fn the_closed_form_is_the_mean_over_the_phase() {
        let settings = AntiScatterGrid {
            focus_mm: None,
            ..clinical()
        };
        let grid = Grid::new(&settings, [0.0; 2]).unwrap();
        let (pitch, height) = (0.25, 2.0);
        let mut rng = Philox::new(4, 0, 0);
        for (energy_kev, slope) in [
            (40.0, 0.003),
            (60.0, 0.01),
            (60.0, 0.03),
            (80.0, 0.11),
            (87.9, 0.3),
            (120.0, 0.9),
            (120.0, -0.062),
        ] {
            let direction = Vector3::new(slope, 0.2, 1.0);
            let per_mm = |name: &str| {
                let material = Material::named(name).unwrap();
                material.total_cm2_g(energy_kev).unwrap() * material.density_g_cm3() / 10.0
            };
            let [strip, space] = ["lead", "aluminium"].map(per_mm);
            let (rays, steps) = (4_000, 800);
            let mut sum = 0.0;
            for ray in 0..rays {
                let phase = pitch * (ray as f64 + rng.unit()) / rays as f64;
                let in_strip = (0..steps)
                    .filter(|&k| {
                        let z = height * (k as f64 + 0.5) / steps as f64;
                        (phase + slope * z).rem_euclid(pitch) < 0.05
                    })
                    .count() as f64
                    / steps as f64;
                let path = height * direction.norm();
                sum += (-path * (in_strip * strip + (1.0 - in_strip) * space)).exp();
            }
            let marched = sum / rays as f64;
            let found = transmission(&grid, energy_kev, 0.0, direction);
            assert!(
                (found / marched - 1.0).abs() < 0.02 && (found - marched).abs() < 5e-4,
                "{energy_kev} keV, slope {slope}: {found}, marched {marched}"
            );
        }
    }

    /// Over uniform steps of the phase, for either direction of tilt: the mean of stationary strips is that of moving ones.
    #[test]
    fn stationary_strips_have_the_mean_of_moving_ones() {
        const STEPS: usize = 20_000;
        let grid = Grid::new(&clinical().with_focus_mm(None), [3.0, -7.0]).unwrap();
        for (energy_kev, slope) in [(40.0, 0.0), (60.0, 0.01), (60.0, -0.03), (88.5, 0.2)] {
            let direction = Vector3::new(slope, 0.2, 1.0).normalize();
            let attenuation = grid.attenuation(energy_kev);
            let expected = grid
                .crossing([40.0, 0.0], &direction)
                .transmission(attenuation);
            let places = (0..STEPS).map(|i| 40.0 + 0.25 * i as f64 / STEPS as f64);
            let sum: f64 = places
                .map(|x| grid.transmission_in_place([x, 0.0], &direction, attenuation))
                .sum();
            let found = sum / STEPS as f64;
            assert!(
                (found - expected).abs() < 1e-4,
                "{slope}: {found}, {expected}"
            );
            let (pattern, _) = grid.pattern(
                [40.0, 0.0],
                &direction,
                grid.way_mm(&direction),
                attenuation,
            );
            let spaces = (-attenuation[1] * grid.way_mm(&direction)).exp();
            assert!((pattern.mean() * spaces / expected - 1.0).abs() < 1e-6);
        }
        // Photons along the strips: the strip at the centre stops them, the space next to it does not.
        let along = |x_mm: f64| {
            grid.transmission_in_place([x_mm, 0.0], &Vector3::z(), grid.attenuation(40.0))
        };
        assert!(along(3.0) < 1e-10 && along(3.024) < 1e-10 && along(2.976) < 1e-10);
        assert!(along(3.026) > 0.5 && along(2.974) > 0.5 && along(3.25) < 1e-10);
        // A photon that comes from lower x has crossed what is there.
        let from_low = Vector3::new(0.05, 0.0, 1.0).normalize();
        let at =
            |x_mm: f64| grid.transmission_in_place([x_mm, 0.0], &from_low, grid.attenuation(40.0));
        assert!(at(3.06) < 0.1 * at(2.94), "{} {}", at(3.06), at(2.94));
    }

    /// Along the strips: D/(D + d) · exp(−μ h) of the spaces, plus the transmission of 2 mm of lead (zero at 60 keV),
    /// everywhere on a grid focused at the source.
    #[test]
    fn primary_passes_the_spaces() {
        let grid = Grid::new(&clinical(), [0.0; 2]).unwrap();
        let aluminium = Material::named("aluminium").unwrap();
        let mu_per_mm = aluminium.total_cm2_g(60.0).unwrap() * aluminium.density_g_cm3() / 10.0;
        for x_mm in [0.0, 80.0, -150.0] {
            let direction = Vector3::new(x_mm, 60.0, 1_100.0);
            let way_mm: f64 = 2.0 * direction.norm() / 1_100.0;
            let expected = 0.8 * (-mu_per_mm * way_mm).exp();
            let found = transmission(&grid, 60.0, x_mm, direction);
            assert!((found / expected - 1.0).abs() < 1e-3, "{found}, {expected}");
        }
    }

    /// A grid without height has no effect, whatever the direction; at the wrong distance it cuts off: the shadow of a strip
    /// covers h x |1/f₁ − 1/f₂| of the space D, which is r x |1/f₁ − 1/f₂| of it.
    #[test]
    fn limits_and_cut_off() {
        let flat = AntiScatterGrid {
            ratio: 0.0,
            ..clinical()
        };
        let flat = Grid::new(&flat, [0.0; 2]).unwrap();
        assert_eq!(
            transmission(&flat, 60.0, 30.0, Vector3::new(2.0, 0.0, 1.0)),
            1.0
        );
        let grid = Grid::new(&clinical(), [0.0; 2]).unwrap();
        let at = |x_mm: f64| transmission(&grid, 40.0, x_mm, Vector3::new(x_mm, 0.0, 900.0));
        let x_mm = 200.0;
        let loss = 10.0 * x_mm * (1.0 / 900.0_f64 - 1.0 / 1_100.0);
        let left = at(x_mm) / at(0.0);
        assert!((left - (1.0 - loss)).abs() < 0.04, "{left}, {}", 1.0 - loss);
        let grazing = transmission(&grid, 60.0, 0.0, Vector3::new(1.0, 0.0, 1e-4));
        assert!((0.0..1e-30).contains(&grazing));
    }

    /// The purpose of a grid: of photons spread evenly within 60° of the normal about a tenth pass a 10:1 grid at 60 keV,
    /// of the primary about two thirds.
    #[test]
    fn scatter_is_stopped_and_primary_is_not() {
        let grid = Grid::new(&clinical(), [0.0; 2]).unwrap();
        let mut scatter = (0.0, 0.0);
        for i in 0..40 {
            for j in 0..40 {
                let cos: f64 = 0.5 + 0.5 * (f64::from(i) + 0.5) / 40.0;
                let (sin_phi, cos_phi) = (f64::from(j) / 40.0 * std::f64::consts::TAU).sin_cos();
                let sin = (1.0 - cos * cos).sqrt();
                let direction = Vector3::new(sin * cos_phi, sin * sin_phi, cos);
                scatter.0 += cos * transmission(&grid, 60.0, 0.0, direction);
                scatter.1 += cos;
            }
        }
        let scatter = scatter.0 / scatter.1;
        let primary = transmission(&grid, 60.0, 0.0, Vector3::z());
        println!("Tp {primary:.3}, Ts {scatter:.3}");
        assert!((0.60..0.75).contains(&primary), "{primary}");
        assert!((0.04..0.16).contains(&scatter), "{scatter}");
    }

    #[test]
    fn grids_that_make_no_sense_are_refused() {
        let refused = |change: fn(&mut AntiScatterGrid)| {
            let mut grid = clinical();
            change(&mut grid);
            Grid::new(&grid, [0.0; 2]).unwrap_err().to_string()
        };
        assert!(refused(|g| g.ratio = -1.0).contains("grid ratio is -1"));
        assert!(refused(|g| g.ratio = f64::NAN).contains("NaN"));
        assert!(refused(|g| g.focus_mm = Some(-900.0)).contains("focal distance"));
        assert!(refused(|g| g.strip_mm = 0.3).contains("no space"));
        assert!(refused(|g| g.interspace = "cheese".to_owned()).contains("cheese"));
    }
}
