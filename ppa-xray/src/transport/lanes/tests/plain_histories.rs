//! Compares the lanes with a simulation of one history at a time, in double precision and without bounds.

use nalgebra::{Point3, Rotation3, Vector3};
use ppa_core::random::Philox;

use super::{phantom, projection};
use crate::beam::emitter::Emission;
use crate::beam::spectrum::Spectrum;
use crate::engine::exposure::Exposure;
use crate::matter::compton::ComptonModel;
use crate::matter::energy_range::CUTOFF_KEV;
use crate::phantom::interpolation::Interpolation;
use crate::phantom::lattice::Walk;
use crate::transport::score::{Arrival, Score};
use crate::transport::tally::Category;
use crate::transport::tracking::Transport;

/// Counts and energies by the way a history ends: absorbed, escaped, or at the plane per category.
#[derive(Default)]
struct Ends {
    counts: [f64; 6],
    energies: [f64; 6],
    squares: [f64; 6],
}

impl Ends {
    fn add(&mut self, end: usize, energy_kev: f64) {
        self.counts[end] += 1.0;
        self.energies[end] += energy_kev;
        self.squares[end] += energy_kev * energy_kev;
    }
}

impl Score for Ends {
    fn deposit(&mut self, _: usize, _: usize, energy_kev: f64) {
        self.add(0, energy_kev);
    }

    fn arrive(&mut self, _: usize, arrival: &Arrival, _: &mut Philox) {
        self.add(2 + arrival.category as usize, arrival.energy_kev);
    }

    fn escape(&mut self, _: usize, energy_kev: f64) {
        self.add(1, energy_kev);
    }
}

/// Follows one history in double precision: the optical depth is used up voxel by voxel, with no bound and no rejection.
fn plain_history(transport: &Transport, rng: &mut Philox, ends: &mut Ends) {
    let Emission {
        origin_mm: mut position,
        mut direction,
        mut energy_kev,
    } = transport.emit(rng);
    let mut order = 0;
    let mut category = Category::Primary;
    loop {
        let to_plane = if direction.z > 0.0 {
            (transport.projection.source_detector_mm - position.z) / direction.z
        } else {
            f64::INFINITY
        };
        let collision = plain_flight(transport, &position, &direction, energy_kev, to_plane, rng);
        let Some((distance_mm, material)) = collision else {
            return if to_plane.is_finite() {
                ends.add(2 + category as usize, energy_kev);
            } else {
                ends.add(1, energy_kev);
            };
        };
        position += direction * distance_mm;
        let sums = transport
            .tables
            .attenuation
            .at(material, transport.tables.attenuation.locate(energy_kev));
        let tables = &transport.tables.samplers[usize::from(material)];
        let xi = rng.unit() as f32 * sums.total;
        let cos_theta = if xi < sums.photoelectric {
            let Some(line_kev) = tables.k_fluorescence(energy_kev, rng.unit()) else {
                return ends.add(0, energy_kev);
            };
            ends.add(0, energy_kev - line_kev);
            energy_kev = line_kev;
            category = Category::Multiple;
            order = 1;
            2.0 * rng.unit() - 1.0
        } else if xi < sums.with_compton {
            let (cos_theta, left_kev) = tables.sample_compton(energy_kev, rng);
            if left_kev < CUTOFF_KEV {
                return ends.add(0, energy_kev);
            }
            ends.add(0, energy_kev - left_kev);
            energy_kev = left_kev;
            category = Category::Compton;
            cos_theta
        } else {
            category = Category::Rayleigh;
            tables.sample_rayleigh(energy_kev, rng)
        };
        order += 1;
        if order > 1 {
            category = Category::Multiple;
        }
        let across = direction.cross(&Vector3::x()).normalize();
        let azimuth = Rotation3::from_scaled_axis(direction * (std::f64::consts::TAU * rng.unit()));
        let (along, sideways) = (cos_theta, (1.0 - cos_theta * cos_theta).max(0.0).sqrt());
        direction = (direction * along + azimuth * across * sideways).normalize();
    }
}

/// Distance to the next collision and the material there.
fn plain_flight(
    transport: &Transport,
    position: &Point3<f64>,
    direction: &Vector3<f64>,
    energy_kev: f64,
    to_plane_mm: f64,
    rng: &mut Philox,
) -> Option<(f64, u8)> {
    let lattice = &transport.lattice;
    let ray = lattice.ray(position, direction);
    let (enter, leave) = lattice.clip(&ray)?;
    let end = leave.min(to_plane_mm);
    let phantom = &transport.tables.phantom;
    let energy = transport.tables.attenuation.locate(energy_kev);
    let mu = |voxel: usize| {
        let total = transport
            .tables
            .attenuation
            .at(phantom.material()[voxel], energy);
        f64::from(phantom.density_g_cm3()[voxel] * total.total)
    };
    let mut depth = -(1.0 - rng.unit()).ln();
    let mut at = enter;
    if phantom.interpolation() == Interpolation::Trilinear {
        // Short steps of constant density, taken at their middle; the voxel is at least 1.7 mm wide.
        const STEP_MM: f64 = 0.1;
        while at < end {
            let next = (at + STEP_MM).min(end);
            let corners = corners(
                &(ray.origin + ray.slope * (0.5 * (at + next))),
                lattice.size,
            );
            let shares = corners.map(|(voxel, weight)| weight * mu(voxel));
            let total: f64 = shares.iter().sum();
            if depth < total * (next - at) {
                let mut left = rng.unit() * total;
                let hit = shares.iter().position(|share| {
                    left -= share;
                    left < 0.0
                });
                let (voxel, _) = corners[hit.unwrap_or(0)];
                return Some((at + depth / total, phantom.material()[voxel]));
            }
            depth -= total * (next - at);
            at = next;
        }
        return None;
    }
    let mut walk = Walk::new(&ray, enter, lattice.size.map(|n| n as u32), 1.0);
    while at < end {
        let mu = mu(walk.index);
        let (axis, next) = walk.exit();
        let next = next.min(end);
        if depth < mu * (next - at) {
            return Some((at + depth / mu, phantom.material()[walk.index]));
        }
        depth -= mu * (next - at);
        at = next;
        if !walk.advance(axis) {
            break;
        }
    }
    None
}

/// The eight voxels around a point, in cells, and their trilinear weights; constant beyond the outermost centres.
fn corners(cell: &Vector3<f64>, size: [usize; 3]) -> [(usize, f64); 8] {
    std::array::from_fn(|corner| {
        let (mut voxel, mut weight, mut stride) = (0, 1.0, 1);
        for axis in 0..3 {
            let last = (size[axis] - 1) as f64;
            let from_centres = (cell[axis] - 0.5).clamp(0.0, last);
            let low = from_centres.floor();
            let upper = corner >> axis & 1 == 1;
            let index = if upper { (low + 1.0).min(last) } else { low };
            weight *= if upper {
                from_centres - low
            } else {
                1.0 - from_centres + low
            };
            voxel += index as usize * stride;
            stride *= size[axis];
        }
        (voxel, weight)
    })
}

/// Bounds, rejection, single precision and the order of random numbers do not change any mean.
#[test]
fn lanes_and_plain_histories_agree() {
    assert_agreement(Interpolation::Nearest);
}

/// The same between centres of voxels, where a randomly chosen neighbour represents all eight.
#[test]
fn lanes_and_plain_histories_agree_between_centres() {
    assert_agreement(Interpolation::Trilinear);
}

fn assert_agreement(interpolation: Interpolation) {
    let (phantom, projection) = (phantom().with_interpolation(interpolation), projection());
    let spectrum = Spectrum::from_bins(&[20.0, 40.0, 70.0], &[1.0, 1.0]).unwrap();
    let model = ComptonModel::default();
    let exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
    let transport = exposure.transport;
    let histories = 400_000;
    let (mut lanes, mut plain) = (Ends::default(), Ends::default());
    transport.follow(1, 0..histories, &mut lanes);
    for history in 0..histories / 2 {
        plain_history(&transport, &mut Philox::new(2, 0, history), &mut plain);
    }
    for end in 0..6 {
        // Sums of independent terms; a history may deposit several times, which counts as independent here: a little
        // too strict, since its deposits exclude each other.
        for (what, sums, squares) in [
            (
                "count",
                [lanes.counts, plain.counts],
                [lanes.counts, plain.counts],
            ),
            (
                "energy",
                [lanes.energies, plain.energies],
                [lanes.squares, plain.squares],
            ),
        ] {
            let difference = sums[0][end] - 2.0 * sums[1][end];
            let sigma = (squares[0][end] + 4.0 * squares[1][end]).sqrt();
            let z = difference / sigma;
            assert!(z.abs() < 4.0, "{what} of end {end}: {z:.1} sigma"); // 12 looks: 8e-4
        }
        assert!(plain.counts[end] > 1_000.0, "end {end} is rare");
    }
}
