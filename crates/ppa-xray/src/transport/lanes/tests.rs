//! The lanes against one history at a time without any bound, and against themselves in other company.

use nalgebra::{Isometry3, Point3, Rotation3, Vector3};
use ppa_ct::Grid;

use super::*;
use crate::beam::emitter::Emission;
use crate::beam::projection::{Detector, Projection};
use crate::beam::spectrum::Spectrum;
use crate::matter::compton::ComptonModel;
use crate::matter::material::Material;
use crate::phantom::lattice::Walk;
use crate::phantom::voxels::VoxelPhantom;
use crate::scenes::limb;
use crate::transport::attenuation::CUTOFF_KEV;
use crate::transport::score::Arrival;

/// The limb of the public tests, with a vessel full of contrast medium.
fn phantom() -> VoxelPhantom {
    let limb = limb(&Isometry3::identity());
    let grid = limb.grid();
    let (material, density) = (0..grid.len())
        .map(|index| {
            let [i, j, _] = grid.voxel(index);
            let (x, y) = (i as f64 * 2.0 - 35.0, j as f64 * 2.5 - 36.25);
            if (x + 18.0).hypot(y) < 8.0 {
                (4, 1.05)
            } else {
                (limb.material()[index], limb.density_g_cm3()[index])
            }
        })
        .unzip();
    let [iodine, water] = ["iodine", "water"].map(|name| Material::named(name).unwrap());
    let contrast = Material::mixture("contrast", 1.05, &[(&iodine, 0.05), (&water, 0.95)]);
    let mut materials = limb.materials().to_vec();
    materials.push(contrast.unwrap());
    VoxelPhantom::new(grid.clone(), material, density, materials).unwrap()
}

/// The detector plane cuts through the air of the box.
fn projection() -> Projection {
    Projection::new(
        Isometry3::translation(0.0, 0.0, -1_000.0),
        1_043.0,
        Detector::centred(60, 60, 2.0),
    )
}

/// What one history left, as bits.
type Events = Vec<[u64; 4]>;

/// Keeps the events of every history.
#[derive(Default)]
struct Recorder {
    under_way: Vec<Events>,
    finished: Vec<Events>,
    /// Emitted less deposited, arrived and escaped, keV.
    balance_kev: Vec<f64>,
    unbalanced: usize,
}

impl Recorder {
    fn note(&mut self, slot: usize, event: [u64; 4], energy_kev: f64) {
        self.under_way[slot].push(event);
        self.balance_kev[slot] -= energy_kev;
    }

    fn sorted(mut self) -> Vec<Events> {
        self.finished.sort_unstable();
        self.finished
    }
}

impl Score for Recorder {
    fn emit(&mut self, slot: usize, energy_kev: f64) {
        assert!(slot < LANES);
        self.under_way.resize(LANES, Events::new());
        self.balance_kev.resize(LANES, 0.0);
        assert!(self.under_way[slot].is_empty(), "slot {slot} is taken");
        self.balance_kev[slot] = energy_kev;
        self.note(slot, [0, energy_kev.to_bits(), 0, 0], 0.0);
    }

    fn deposit(&mut self, slot: usize, voxel: usize, energy_kev: f64) {
        self.note(slot, [1, voxel as u64, energy_kev.to_bits(), 0], energy_kev);
    }

    fn arrive(&mut self, slot: usize, arrival: &Arrival, rng: &mut Philox) {
        let place = [arrival.x_mm.to_bits(), arrival.y_mm.to_bits()];
        let event = [
            2 + arrival.category as u64,
            place[0],
            place[1],
            rng.unit().to_bits(),
        ];
        self.note(slot, event, arrival.energy_kev);
    }

    fn escape(&mut self, slot: usize, energy_kev: f64) {
        self.note(slot, [9, energy_kev.to_bits(), 0, 0], energy_kev);
    }

    fn finish(&mut self, slot: usize) {
        self.finished
            .push(std::mem::take(&mut self.under_way[slot]));
        self.unbalanced += usize::from(self.balance_kev[slot].abs() > 1e-9);
    }
}

fn record(transport: &Transport, isa: Isa, ranges: &[Range<u64>]) -> Vec<Events> {
    let mut recorder = Recorder::default();
    for range in ranges {
        Lanes::new(transport, isa, 5, range.clone()).run(&mut recorder);
    }
    assert_eq!(recorder.unbalanced, 0, "energy appears or vanishes");
    recorder.sorted()
}

#[test]
fn company_and_vector_width_change_no_bit() {
    let (phantom, projection) = (phantom(), projection());
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let transport =
        Transport::new(&phantom, &spectrum, &projection, ComptonModel::default()).unwrap();
    let whole = record(&transport, Isa::widest(), std::slice::from_ref(&(0..6_000)));
    assert_eq!(whole.len(), 6_000);
    let parts = [0..1, 1..65, 65..65, 65..200, 200..3_000, 3_000..6_000];
    assert_eq!(record(&transport, Isa::widest(), &parts), whole, "parts");
    for isa in Isa::all() {
        assert_eq!(
            record(&transport, isa, std::slice::from_ref(&(0..6_000))),
            whole,
            "{isa:?}"
        );
    }
}

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

/// One history in double precision: the optical depth is spent voxel by voxel, with no bound and no rejection.
fn plain_history(transport: &Transport, rng: &mut Philox, ends: &mut Ends) {
    let Emission {
        origin_mm: mut position,
        mut direction,
        mut energy_kev,
    } = transport.emitter.emit(rng);
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
            .attenuation
            .at(material, transport.attenuation.locate(energy_kev));
        let tables = &transport.samplers[usize::from(material)];
        let lot = rng.unit() as f32 * sums.total;
        let cos_theta = if lot < sums.photoelectric {
            let Some(line_kev) = tables.k_fluorescence(energy_kev, rng.unit()) else {
                return ends.add(0, energy_kev);
            };
            ends.add(0, energy_kev - line_kev);
            energy_kev = line_kev;
            category = Category::Multiple;
            order = 1;
            2.0 * rng.unit() - 1.0
        } else if lot < sums.with_compton {
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
    let mut walk = Walk::new(&ray, enter, lattice.size.map(|n| n as u32), 1.0);
    let energy = transport.attenuation.locate(energy_kev);
    let mut depth = -(1.0 - rng.unit()).ln();
    let mut at = enter;
    while at < end {
        let material = transport.phantom.material()[walk.index];
        let density = transport.phantom.density_g_cm3()[walk.index];
        let mu = f64::from(density * transport.attenuation.at(material, energy).total);
        let (axis, next) = walk.exit();
        let next = next.min(end);
        if depth < mu * (next - at) {
            return Some((at + depth / mu, material));
        }
        depth -= mu * (next - at);
        at = next;
        if !walk.advance(axis) {
            break;
        }
    }
    None
}

/// Bounds, rejection, single precision and the order of random numbers leave every mean where it is.
#[test]
fn lanes_and_plain_histories_agree() {
    let (phantom, projection) = (phantom(), projection());
    let spectrum = Spectrum::from_bins(&[20.0, 40.0, 70.0], &[1.0, 1.0]).unwrap();
    let transport =
        Transport::new(&phantom, &spectrum, &projection, ComptonModel::default()).unwrap();
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

/// Photons of the energies of K lines, by the side of the foil on which they leave.
#[derive(Default)]
struct KRays {
    lines: Vec<f64>,
    /// Towards the detector, away from it.
    leave: [f64; 2],
}

impl KRays {
    fn count(&mut self, side: usize, energy_kev: f64) -> bool {
        let is_line = |line: &f64| (*line - energy_kev).abs() < 1e-5;
        let is_k_ray = self.lines.iter().any(is_line);
        self.leave[side] += f64::from(u8::from(is_k_ray));
        is_k_ray
    }
}

impl Score for KRays {
    fn arrive(&mut self, _: usize, arrival: &Arrival, _: &mut Philox) {
        let is_k_ray = self.count(0, arrival.energy_kev);
        assert!(!is_k_ray || arrival.category == Category::Multiple);
    }

    fn escape(&mut self, _: usize, energy_kev: f64) {
        self.count(1, energy_kev);
    }
}

/// K x-rays that leave an iodine foil of 0.02 mm on either side, against the integral over depth and direction of
/// emission times transmission.
///
/// Scattered photons may still be absorbed, and scattered K x-rays still leave: attenuation without scattering gives the
/// most that may leave and attenuation with it the least, 1 % apart. 4.5 standard errors beyond (7e-6 each), 2.5 %.
#[test]
fn k_x_rays_leave_a_foil_as_the_integral_says() {
    let (side_mm, thickness_mm, incident_kev) = (400.0, 0.02, 60.0);
    let grid = Grid::axis_aligned(
        [1, 1, 1],
        Vector3::new(side_mm, side_mm, thickness_mm),
        Point3::origin(),
    );
    let iodine = Material::named("iodine").unwrap();
    let (density, density_f32) = (iodine.density_g_cm3(), iodine.density_g_cm3() as f32);
    let lines = iodine.k_fluorescence(incident_kev);
    let at = iodine.cross_sections(incident_kev).unwrap();
    let phantom = VoxelPhantom::new(
        grid.unwrap(),
        vec![0],
        vec![density_f32],
        vec![iodine.clone()],
    );
    let phantom = phantom.unwrap();
    let spectrum = Spectrum::monoenergetic(incident_kev).unwrap();
    let mut exposure = projection();
    exposure.detector = Detector::centred(10, 10, 1.0);
    let transport =
        Transport::new(&phantom, &spectrum, &exposure, ComptonModel::default()).unwrap();
    let mut found = KRays {
        lines: lines
            .iter()
            .map(|line| f64::from(line.energy_kev as f32))
            .collect(),
        ..KRays::default()
    };
    let histories = 2_000_000;
    transport.follow(3, 0..histories, &mut found);

    let per_mm = |cm2_g: f64| cm2_g * density / 10.0;
    let middle = |i: u32, count: u32| (f64::from(i) + 0.5) / f64::from(count);
    // Of photons emitted at a depth, half go to either side, evenly over the cosine.
    let out = |mu: f64, way_mm: f64| -> f64 {
        let cosines = (0..400).map(|i| (-mu * way_mm / middle(i, 400)).exp());
        0.5 * cosines.sum::<f64>() / 400.0
    };
    let leaving = |is_back: bool, scattering: f64| -> f64 {
        let depths = (0..100).map(|i| thickness_mm * middle(i, 100));
        let from_depth = |depth_mm: f64| -> f64 {
            let way_mm = if is_back {
                depth_mm
            } else {
                thickness_mm - depth_mm
            };
            let of_lines = lines.iter().map(|line| {
                let k = iodine.cross_sections(line.energy_kev).unwrap();
                let attenuation = k.photoelectric + scattering * (k.compton + k.rayleigh);
                line.probability * out(per_mm(attenuation), way_mm)
            });
            let attenuation = at.photoelectric + scattering * (at.compton + at.rayleigh);
            let absorbed = per_mm(at.photoelectric) * (-per_mm(attenuation) * depth_mm).exp();
            absorbed * of_lines.sum::<f64>()
        };
        depths.map(from_depth).sum::<f64>() * thickness_mm / 100.0 * histories as f64
    };
    for (side, found) in found.leave.into_iter().enumerate() {
        let [least, most] = [1.0, 0.0].map(|scattering| leaving(side == 1, scattering));
        let sigma = found.sqrt();
        println!("side {side}: {found} ± {sigma:.0}, {least:.0} to {most:.0}");
        assert!(least - 4.5 * sigma < found && found < most + 4.5 * sigma);
    }
}

/// A tentative collision a hair before the far wall of the box: the next block is that of the last voxel still.
#[test]
fn rounding_takes_no_photon_onto_the_far_wall() {
    let space = Box32 {
        cell_from_device: [[0.0; 4]; 3],
        device_z: [0.0; 4],
        source_detector_mm: 100.0,
        size: [40.0; 3],
        blocks: [5; 3],
        edge: 8.0,
    };
    let (mut flights, mut blocks, mut steps) = (Flights::new(), Blocks::new(), Steps::new());
    let count = LANES;
    flights.position = [[39.0; LANES]; 3];
    flights.to_plane_mm = [100.0; LANES];
    // 39 + 0.99999994 rounds to 40.
    flights.depth = [1.0_f32.next_down(); LANES];
    let isa = Isa::widest();
    isa.run(Locate {
        space: &space,
        flights: &flights,
        blocks: &mut blocks,
        count,
    });
    blocks.bound = [1.0; LANES];
    isa.run(Advance {
        space: &space,
        flights: &mut flights,
        blocks: &blocks,
        steps: &mut steps,
        count,
    });
    assert!(steps.outcome.iter().all(|&o| o == Steps::TENTATIVE));
    isa.run(Locate {
        space: &space,
        flights: &flights,
        blocks: &mut blocks,
        count,
    });
    assert!(blocks.index.iter().all(|&block| block == 124));
}
