//! A synthetic leg for tests of the audit.

use nalgebra::{Matrix3, Point3, Vector3};
use ppa_ct::audit::{Audit, FindingCode};
use ppa_ct::{Acquisition, Grid, Scan, Volume};

/// A leg of 90 mm diameter with a bone of 30 mm along z in air, 2 mm voxels, 160 x 160 x 60 mm;
/// noise of a few HU, the same everywhere.
pub struct Leg {
    pub centre: [f64; 2],
    pub couch_y: Option<f64>,
    pub length: [f64; 2],
    pub plate_hu: f32,
    pub change: fn(f32) -> f32,
    pub acquisition: Acquisition,
    pub direction: Matrix3<f64>,
    pub slice_mm: f64,
}

impl Default for Leg {
    fn default() -> Self {
        Self {
            centre: [80.0, 70.0],
            couch_y: None,
            length: [-1.0, 61.0],
            plate_hu: 400.0,
            change: |hu| hu,
            acquisition: Acquisition::default(),
            direction: Matrix3::identity(),
            slice_mm: 2.0,
        }
    }
}

impl Leg {
    pub fn scan(self) -> Scan {
        let spacing = Vector3::new(2.0, 2.0, self.slice_mm);
        let size = [80, 80, (60.0 / self.slice_mm) as usize];
        let grid =
            Grid::from_parts(size, self.direction, spacing, Point3::new(3.0, 4.0, 5.0)).unwrap();
        let hu = (0..grid.len()).map(|n| {
            let [i, j, k] = grid.voxel(n);
            let (x, y, z) = (2.0 * i as f64, 2.0 * j as f64, self.slice_mm * k as f64);
            // A fixed pattern instead of noise: −18..=18 HU.
            let noise = ((n * 7919) % 37) as f32 - 18.0;
            let r = (x - self.centre[0]).hypot(y - self.centre[1]);
            let inside = (self.length[0]..self.length[1]).contains(&z);
            let on_couch = self.couch_y.is_some_and(|c| (y - c).abs() < 2.5);
            let hu = match r {
                r if r < 4.0 && inside => self.plate_hu.max(1000.0),
                r if r < 15.0 && inside => 800.0,
                r if r < 45.0 && inside => 45.0,
                _ if on_couch => -300.0,
                _ => -1000.0,
            };
            (self.change)(hu + noise)
        });
        let hu = hu.collect();
        Scan {
            volume: Volume::new(grid, hu).unwrap(),
            modality: Some("CT".to_owned()),
            series: Vec::new(),
            acquisition: self.acquisition,
            warnings: Vec::new(),
        }
    }

    pub fn audit(self) -> Audit {
        Audit::of(&self.scan())
    }

    pub fn codes(self) -> Vec<FindingCode> {
        self.audit().findings.iter().map(|f| f.code).collect()
    }
}

pub fn stated(change: impl Fn(&mut Acquisition)) -> Leg {
    let mut leg = Leg::default();
    change(&mut leg.acquisition);
    leg
}
