//! Each history is independent of the other lanes and conserves energy.

mod k_x_rays;
mod plain_histories;

use nalgebra::Isometry3;

use super::*;
use crate::beam::detector::Detector;
use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::engine::exposure::Exposure;
use crate::matter::compton::ComptonModel;
use crate::matter::material::Material;
use crate::phantom::voxels::VoxelPhantom;
use crate::scenes::limb;
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

/// Events of one history, as bits.
type Events = Vec<[u64; 4]>;

/// Records the events of every history.
#[derive(Default)]
struct Recorder {
    under_way: Vec<Events>,
    finished: Vec<Events>,
    /// Emitted minus deposited, arrived and escaped energy, keV.
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
    let model = ComptonModel::default();
    let exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
    let transport = exposure.transport;
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

/// A tentative collision just before the far wall of the box: the next block is still that of the last voxel.
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
