//! Test that no history creates or loses energy.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_core::random::Philox;
use ppa_ct::Grid;
use proptest::prelude::*;

use crate::beam::detector::Detector;
use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::engine::exposure::Exposure;
use crate::matter::compton::ComptonModel;
use crate::matter::material::Material;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::score::{Arrival, Score};

const MATERIALS: [&str; 5] = ["air", "water", "bone_cortical", "titanium", "lead"];

/// Energy balance of the history in every slot.
#[derive(Default)]
struct Balance {
    /// Emitted energy and the part of it that has been accounted for, keV.
    slots: Vec<Option<(f64, f64)>>,
    finished: u64,
    worst: f64,
}

impl Balance {
    fn account(&mut self, slot: usize, energy_kev: f64) {
        assert!(energy_kev >= 0.0, "{energy_kev} keV");
        self.slots[slot].as_mut().expect("a history under way").1 += energy_kev;
    }
}

impl Score for Balance {
    fn emit(&mut self, slot: usize, energy_kev: f64) {
        if slot >= self.slots.len() {
            self.slots.resize(slot + 1, None);
        }
        assert!(self.slots[slot].is_none(), "the slot is free");
        self.slots[slot] = Some((energy_kev, 0.0));
    }

    fn deposit(&mut self, slot: usize, _voxel: usize, energy_kev: f64) {
        self.account(slot, energy_kev);
    }

    fn arrive(&mut self, slot: usize, arrival: &Arrival, _rng: &mut Philox) {
        self.account(slot, arrival.energy_kev);
    }

    fn escape(&mut self, slot: usize, energy_kev: f64) {
        self.account(slot, energy_kev);
    }

    fn finish(&mut self, slot: usize) {
        let (emitted, accounted) = self.slots[slot].take().expect("a history under way");
        self.worst = self.worst.max((accounted / emitted - 1.0).abs());
        self.finished += 1;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Emitted = deposited + arrived + escaped, history by history, in phantoms of random materials and densities.
    #[test]
    fn every_history_balances(
        size in [1..14_usize, 1..14, 1..20],
        voxels in prop::collection::vec((0..MATERIALS.len() as u8, 0.0..3.0_f32), 40),
        spacing_mm in 0.5..12.0_f64,
        // Compton scattering takes the softest photons below the cutoff.
        low_kev in prop_oneof![Just(5.02), 5.0..100.0_f64],
        width_kev in prop_oneof![Just(0.0), 0.0..50.0_f64],
        seed in any::<u64>(),
        impulse in any::<bool>(),
    ) {
        let grid = Grid::axis_aligned(size, Vector3::repeat(spacing_mm), Point3::origin()).unwrap();
        // Not periodic in the lattice.
        let (material, density) = (0..grid.len())
            .map(|n| voxels[n.wrapping_mul(2_654_435_761) % 2_147_483_647 % voxels.len()])
            .unzip();
        let materials = MATERIALS.map(|name| Material::named(name).unwrap()).to_vec();
        let phantom = VoxelPhantom::new(grid, material, density, materials).unwrap();
        let centre = phantom.grid().centre(size.map(|n| 0.5 * (n as f64 - 1.0)));
        let pose = Isometry3::translation(centre.x, centre.y, centre.z - 300.0);
        let projection = Projection::new(pose, 500.0, Detector::centred(20, 20, 10.0));
        let spectrum = Spectrum::from_bins(&[low_kev, low_kev + width_kev + 1e-3], &[1.0]).unwrap();
        let model = if impulse {
            ComptonModel::ImpulseApproximation
        } else {
            ComptonModel::IncoherentFunction
        };
        let exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
        let transport = exposure.transport;
        let mut balance = Balance::default();
        transport.follow(seed, 100..2_100, &mut balance);
        prop_assert_eq!(balance.finished, 2_000);
        prop_assert!(balance.slots.iter().all(Option::is_none), "a history never ended");
        prop_assert!(balance.worst < 1e-6, "one history is off by {:e}", balance.worst);
    }
}
