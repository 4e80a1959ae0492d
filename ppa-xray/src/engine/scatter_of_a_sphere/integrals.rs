//! Integrals of the differential cross sections over all paths through the sphere.
//!
//! They involve no sampling of angles or free paths and no tracking: the nodes are the additive recurrence of irrational steps
//! (Niederreiter, *Random Number Generation and Quasi-Monte Carlo Methods*, 1992, ch. 3), which fills the space of the paths evenly.
//! Other starting points change the integrals by up to 0.4 % in a ring and 0.1 % overall (single scatter), 2 % and 0.4 % (multiple
//! scatter).

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use crate::engine::scatter_of_a_sphere::scene::{
    BEHIND_MM, PIXEL_MM, PIXELS, RINGS, SOURCE_MM, Scene, detector, ring,
};
use crate::matter::cross_sections::{ELECTRON_REST_KEV, HC_KEV_ANGSTROM};
use crate::matter::material::Material;

/// One interaction: coefficient per solid angle in 1/(mm sr), and the energy after it.
pub(super) type Scatterer<'a> = &'a dyn Fn(f64, f64) -> (f64, f64);

/// A Klein–Nishina differential cross section per electron, cm²/sr, and E′/E.
pub(super) fn klein_nishina(energy_kev: f64, cos: f64) -> (f64, f64) {
    const ELECTRON_RADIUS_CM: f64 = 2.817_940_3e-13;
    let ratio = 1.0 / (1.0 + energy_kev / ELECTRON_REST_KEV * (1.0 - cos));
    let bracket = ratio + 1.0 / ratio - (1.0 - cos * cos);
    (
        0.5 * ELECTRON_RADIUS_CM.powi(2) * ratio * ratio * bracket,
        ratio,
    )
}

/// ∫ f dΩ over the sphere, where f is a forward-peaked function of cos θ.
fn over_the_sphere(f: impl Fn(f64) -> f64) -> f64 {
    let n = 4_000;
    // cos θ = 1 − 2 u⁴ resolves the peak.
    (0..n)
        .map(|i| (f64::from(i) + 0.5) / f64::from(n))
        .map(|u| f(1.0 - 2.0 * u.powi(4)) * 8.0 * u.powi(3) * 2.0 * PI / f64::from(n))
        .sum()
}

/// sin(θ/2)/λ in 1/Å.
fn momentum(energy_kev: f64, cos: f64) -> f64 {
    (0.5 * (1.0 - cos)).sqrt() * energy_kev / HC_KEV_ANGSTROM
}

/// Coefficients of both kinds of scattering, interpolated over energy since their integrals take time.
pub(super) struct Scattering {
    material: Material,
    density_g_cm3: f64,
    /// σ/∫shape dΩ in steps of 1 keV.
    scale: Vec<[f64; 2]>,
}

impl Scattering {
    pub(super) fn new(scene: &Scene) -> Self {
        let material = scene.material.clone();
        let scale = (1..=scene.energy_kev.ceil() as usize + 1)
            .map(|kev| {
                let energy_kev = kev as f64;
                let rayleigh = over_the_sphere(|cos| rayleigh_shape(&material, energy_kev, cos));
                let compton = over_the_sphere(|cos| compton_shape(&material, energy_kev, cos).0);
                [
                    material.rayleigh_cm2_g(energy_kev).unwrap() / rayleigh,
                    material.compton_cm2_g(energy_kev).unwrap() / compton,
                ]
            })
            .collect();
        Self {
            material,
            density_g_cm3: scene.density_g_cm3,
            scale,
        }
    }

    fn scale(&self, energy_kev: f64, which: usize) -> f64 {
        let node = energy_kev as usize - 1;
        let mix = energy_kev.fract();
        self.scale[node][which] * (1.0 - mix) + self.scale[node + 1][which] * mix
    }

    pub(super) fn rayleigh(&self, energy_kev: f64, cos: f64) -> (f64, f64) {
        let shape = rayleigh_shape(&self.material, energy_kev, cos);
        (
            self.scale(energy_kev, 0) * shape * self.density_g_cm3 / 10.0,
            energy_kev,
        )
    }

    pub(super) fn compton(&self, energy_kev: f64, cos: f64) -> (f64, f64) {
        let (shape, ratio) = compton_shape(&self.material, energy_kev, cos);
        (
            self.scale(energy_kev, 1) * shape * self.density_g_cm3 / 10.0,
            energy_kev * ratio,
        )
    }
}

/// (1 + cos²θ) F².
fn rayleigh_shape(material: &Material, energy_kev: f64, cos: f64) -> f64 {
    (1.0 + cos * cos) * material.form_factor_squared_per_gram(momentum(energy_kev, cos))
}

/// Klein–Nishina × S, and E′/E.
fn compton_shape(material: &Material, energy_kev: f64, cos: f64) -> (f64, f64) {
    let (shape, ratio) = klein_nishina(energy_kev, cos);
    (
        shape * 1e26 * material.incoherent_per_gram(momentum(energy_kev, cos)),
        ratio,
    )
}

/// Energy per history in keV that reaches each ring after `orders.len()` interactions of those kinds.
pub(super) fn integrate(scene: &Scene, orders: &[Scatterer], nodes: usize) -> [f64; RINGS] {
    let radius_mm = scene.phantom().1;
    let projection = scene.projection();
    let field_sr = projection
        .field()
        .solid_angle_sr(Point3::origin().xy(), projection.source_detector_mm);
    let steps = irrational_steps(5 + 3 * (orders.len() - 1));
    let volume_mm3 = 4.0 / 3.0 * PI * radius_mm.powi(3);
    let side_mm = f64::from(PIXELS) * PIXEL_MM;
    let source = Point3::new(0.0, 0.0, -SOURCE_MM);
    // Distance from a point in the sphere along a direction to its surface.
    let to_surface = |at: &Point3<f64>, direction: &Vector3<f64>| {
        let along = at.coords.dot(direction);
        -along
            + (along * along + radius_mm * radius_mm - at.coords.norm_squared())
                .max(0.0)
                .sqrt()
    };
    let mut rings = [0.0; RINGS];
    for node in 0..nodes {
        let mut u = steps
            .iter()
            .map(|step| (0.5 + step * (node as f64 + 1.0)).fract());
        let mut u = || u.next().unwrap();
        let mut at = Point3::from(radius_mm * u().cbrt() * on_sphere(u(), u()));
        let pixel_point = Point3::new(side_mm * (u() - 0.5), side_mm * (u() - 0.5), BEHIND_MM);
        let from_source = at - source;
        let mut direction = from_source.normalize();
        let mut energy_kev = scene.energy_kev;
        let mut weight = volume_mm3 / (field_sr * from_source.norm_squared());
        weight *= (-scene.mu_per_mm(energy_kev) * to_surface(&at, &-direction)).exp();
        let (last, before) = orders.split_last().unwrap();
        for interaction in before {
            // cos θ = 1 − 2 v² resolves the forward peak: dcos = 4 v dv.
            let v = u();
            let cos = 1.0 - 2.0 * v * v;
            let (per_mm_sr, energy_after) = interaction(energy_kev, cos);
            direction = rotated(&direction, cos, 2.0 * PI * u());
            let reach_mm = to_surface(&at, &direction);
            let flight_mm = reach_mm * u();
            energy_kev = energy_after;
            weight *= per_mm_sr * 4.0 * v * 2.0 * PI * reach_mm;
            weight *= (-scene.mu_per_mm(energy_kev) * flight_mm).exp();
            at += direction * flight_mm;
        }
        let to_pixel = pixel_point - at;
        let leaving = to_pixel.normalize();
        let (per_mm_sr, energy_after) = last(energy_kev, direction.dot(&leaving));
        weight *= per_mm_sr * leaving.z / to_pixel.norm_squared() * side_mm * side_mm;
        weight *= (-scene.mu_per_mm(energy_after) * to_surface(&at, &leaving)).exp();
        let pixel = detector()
            .raster()
            .cell_at(pixel_point.x, pixel_point.y)
            .unwrap();
        rings[ring(pixel)] += weight * energy_after / nodes as f64;
    }
    rings
}

/// Powers of the inverse of the root of x^(d+1) = x + 1: steps whose multiples fill the unit cube of d dimensions evenly.
fn irrational_steps(dimensions: usize) -> Vec<f64> {
    let mut root = 2.0_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (dimensions as f64 + 1.0));
    }
    (1..=dimensions as i32)
        .map(|power| root.powi(-power))
        .collect()
}

fn on_sphere(u: f64, v: f64) -> Vector3<f64> {
    let z = 2.0 * u - 1.0;
    let (sin, cos) = (2.0 * PI * v).sin_cos();
    Vector3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vector3::z() * z
}

fn rotated(direction: &Vector3<f64>, cos: f64, azimuth: f64) -> Vector3<f64> {
    let aside = if direction.x.abs() < 0.5 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let first = direction.cross(&aside).normalize();
    let second = direction.cross(&first);
    let across = first * azimuth.cos() + second * azimuth.sin();
    direction * cos + across * (1.0 - cos * cos).max(0.0).sqrt()
}
