//! Tibia, fibula and talus as smooth bodies.

use nalgebra::{Affine3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_dataset::labels::BoneNumbers;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::blocks::Blocks;

/// A bone of the ankle joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AnkleBone {
    /// Shin bone, with plafond and medial malleolus.
    Tibia,
    /// Calf bone, with the lateral malleolus.
    Fibula,
    /// Ankle bone, with the trochlea.
    Talus,
}

impl AnkleBone {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Tibia, Self::Fibula, Self::Talus];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Tibia => "tibia",
            Self::Fibula => "fibula",
            Self::Talus => "talus",
        }
    }
}

impl AnkleBone {
    /// The label of the bone.
    pub(crate) fn number(self, numbers: BoneNumbers) -> u8 {
        match self {
            Self::Tibia => numbers.tibia,
            Self::Fibula => numbers.fibula,
            Self::Talus => numbers.talus,
        }
    }
}

/// Why labels do not give the bones of an ankle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BonesError {
    /// The number of labels differs from the number of voxels.
    #[error("{}, expected {expected}, one per voxel", ppa_core::text::count(*found, "label"))]
    Count {
        /// Labels.
        found: usize,
        /// Voxels.
        expected: usize,
    },
    /// Voxels so large that a gutter is hardly wider than its blur.
    #[error("voxels of {} mm, expected at most {MOST_VOXEL_MM} mm along each axis: a gutter is 2 to 3 mm wide",
        found_mm.map(|side| format!("{side:.2}")).join(" x "))]
    Coarse {
        /// Sides of a voxel.
        found_mm: [f64; 3],
    },
    /// A bone is missing near the joint.
    #[error("no voxel of the {bone} (label {label}) lies within {reach_mm} mm of the joint")]
    Missing {
        /// The bone.
        bone: &'static str,
        /// Its label.
        label: u8,
        /// Half the side of the searched box.
        reach_mm: f64,
    },
}

/// Half the side of the box around the joint that is searched, mm: it includes the whole talus and both malleoli.
const REACH_MM: f64 = 60.0;
/// Longest side of a voxel, mm: the blur and the rim of a facet grow with it, and a gutter of 2.5 mm is then two voxels wide.
const MOST_VOXEL_MM: f64 = 1.25;
/// Blur of the labels, voxels: it smooths the stair-stepped surface to about a tenth of a voxel.
const BLUR_VOXELS: f64 = 0.8;

/// The bones around an ankle: blurred indicators whose level 1/2 is the surface.
#[derive(Debug, Clone)]
pub struct AnkleBones {
    size: [usize; 3],
    voxel_from_ct: Affine3<f64>,
    ct_from_voxel: Affine3<f64>,
    spacing_mm: Vector3<f64>,
    /// Tibia, fibula, talus.
    bodies: [Body; 3],
    /// All bones.
    skeleton: Body,
}

/// A blurred indicator over the voxels of the box.
#[derive(Debug, Clone)]
pub(super) struct Body {
    values: Vec<f32>,
    /// Blocks of cells between eight voxels each; blocks entirely on one side of the surface are uniform.
    blocks: Blocks,
}

impl Body {
    fn new(values: Vec<f32>, size: [usize; 3]) -> Self {
        let [nx, ny, _] = size;
        let inside = |low: [usize; 3], high: [usize; 3]| {
            let first = values[(low[2] * ny + low[1]) * nx + low[0]] >= 0.5;
            let mut rows =
                (low[2]..=high[2]).flat_map(|k| (low[1]..=high[1]).map(move |j| (k * ny + j) * nx));
            let alike = rows.all(|row| {
                let row = &values[row + low[0]..=row + high[0]];
                row.iter().all(|&value| (value >= 0.5) == first)
            });
            alike.then_some(first)
        };
        let blocks = Blocks::new(size.map(|n| n.saturating_sub(1)), inside);
        Self { values, blocks }
    }

    /// Whether the points of a cell and those around it are inside, and by how many voxels every coordinate may change before the surface
    /// is reached; `None` near it.
    pub fn side(&self, cell: [usize; 3]) -> Option<(bool, usize)> {
        self.blocks.uniform(cell)
    }

    /// One value per voxel of the box, i fastest.
    pub fn values(&self) -> &[f32] {
        &self.values
    }
}

impl AnkleBones {
    /// Builds the bones within 60 mm of the joint from one label per voxel, i fastest; 0 is no bone.
    ///
    /// # Errors
    /// [`BonesError`] when a label is missing near the joint, voxels are larger than 1.25 mm, or the number of labels differs from the
    /// number of voxels.
    pub fn new(
        grid: &Grid,
        labels: &[u8],
        numbers: BoneNumbers,
        joint: &Point3<f64>,
    ) -> Result<Self, BonesError> {
        if labels.len() != grid.len() {
            return Err(BonesError::Count {
                found: labels.len(),
                expected: grid.len(),
            });
        }
        let found_mm = grid.spacing_mm();
        if found_mm.max() > MOST_VOXEL_MM {
            return Err(BonesError::Coarse {
                found_mm: found_mm.into(),
            });
        }
        let (low, size) = box_around(grid, joint);
        let indicator = |holds: &dyn Fn(u8) -> bool| -> Vec<f32> {
            let mut values = Vec::with_capacity(size.iter().product());
            for k in low[2]..low[2] + size[2] {
                for j in low[1]..low[1] + size[1] {
                    let row = grid.index([low[0], j, k]);
                    let row = &labels[row..row + size[0]];
                    values.extend(row.iter().map(|&l| f32::from(u8::from(holds(l)))));
                }
            }
            values
        };
        for bone in AnkleBone::ALL {
            let label = bone.number(numbers);
            if !indicator(&|l| l == label).contains(&1.0) {
                return Err(BonesError::Missing {
                    bone: bone.name(),
                    label,
                    reach_mm: REACH_MM,
                });
            }
        }
        let shift = nalgebra::Translation3::new(low[0] as f64, low[1] as f64, low[2] as f64);
        let ct_from_voxel = grid.ct_from_voxel() * shift;
        let blurred = |holds: &dyn Fn(u8) -> bool| Body::new(blur(indicator(holds), size), size);
        Ok(Self {
            size,
            voxel_from_ct: ct_from_voxel.inverse(),
            ct_from_voxel,
            spacing_mm: grid.spacing_mm(),
            bodies: AnkleBone::ALL.map(|bone| blurred(&|l| l == bone.number(numbers))),
            skeleton: blurred(&|l| l != 0),
        })
    }

    pub(super) fn size(&self) -> [usize; 3] {
        self.size
    }

    /// The longest side of a voxel, mm.
    pub(super) fn coarseness_mm(&self) -> f64 {
        self.spacing_mm.max()
    }

    pub(super) fn voxel(&self, p: &Point3<f64>) -> Point3<f64> {
        self.voxel_from_ct * p
    }

    pub(super) fn voxel_vector(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.voxel_from_ct * v
    }

    pub(super) fn centre(&self, voxel: [usize; 3]) -> Point3<f64> {
        self.ct_from_voxel * Point3::from(voxel.map(|v| v as f64))
    }

    pub(super) fn body(&self, bone: AnkleBone) -> &Body {
        &self.bodies[bone as usize]
    }

    pub(super) fn skeleton(&self) -> &Body {
        &self.skeleton
    }

    /// Trilinear value of a body at voxel coordinates; 0 outside the box.
    pub(super) fn at(&self, body: &Body, voxel: &Point3<f64>) -> f32 {
        let Some([i, j, k]) = self.cell(voxel) else {
            return 0.0;
        };
        let body = &body.values;
        let [nx, ny, _] = self.size;
        let (fx, fy, fz) = (
            (voxel.x - i as f64) as f32,
            (voxel.y - j as f64) as f32,
            (voxel.z - k as f64) as f32,
        );
        let first = (k * ny + j) * nx + i;
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let along = |at: usize| mix(body[at], body[at + 1], fx);
        let face = |at: usize| mix(along(at), along(at + nx), fy);
        mix(face(first), face(first + nx * ny), fz)
    }

    /// The cell between eight voxels that contains a point.
    pub(super) fn cell(&self, voxel: &Point3<f64>) -> Option<[usize; 3]> {
        let [nx, ny, nz] = self.size;
        let inside = |v: f64, n: usize| v >= 0.0 && v < (n - 1) as f64;
        (inside(voxel.x, nx) && inside(voxel.y, ny) && inside(voxel.z, nz))
            .then(|| [voxel.x as usize, voxel.y as usize, voxel.z as usize])
    }

    /// Outward unit normal of a body in the `ct` frame, from central differences over half a voxel to each side; `None` if the body
    /// has no slope.
    pub(super) fn normal(&self, body: &Body, p: &Point3<f64>) -> Option<Vector3<f64>> {
        let step = 0.5 * self.spacing_mm.min();
        let value = |offset: Vector3<f64>| f64::from(self.at(body, &self.voxel(&(p + offset))));
        let slope = Vector3::from_fn(|axis, _| {
            let offset = Vector3::ith(axis, step);
            value(-offset) - value(offset)
        });
        slope.try_normalize(1e-6)
    }
}

/// First voxel and size of the box around the joint, cut to the lattice; at least 2 voxels along each axis where there
/// are as many.
pub(crate) fn box_around(grid: &Grid, joint: &Point3<f64>) -> ([usize; 3], [usize; 3]) {
    let centre = grid.voxel_from_ct() * joint;
    let spacing = grid.spacing_mm();
    let (mut low, mut size) = ([0; 3], [0; 3]);
    for axis in 0..3 {
        let reach = REACH_MM / spacing[axis];
        let last = (grid.size()[axis] - 1) as f64;
        let from = (centre[axis] - reach).floor().clamp(0.0, last) as usize;
        let to = (centre[axis] + reach).ceil().clamp(0.0, last) as usize;
        low[axis] = from;
        size[axis] = to - from + 1;
    }
    (low, size)
}

/// Gaussian blur along the three axes; values outside the box are those of its border.
fn blur(mut values: Vec<f32>, size: [usize; 3]) -> Vec<f32> {
    const REACH: isize = 3;
    let weight = |d: isize| (-0.5 * (d as f64 / BLUR_VOXELS).powi(2)).exp();
    let sum: f64 = (-REACH..=REACH).map(weight).sum();
    let weights: Vec<f32> = (-REACH..=REACH).map(|d| (weight(d) / sum) as f32).collect();
    let [columns, rows, _] = size;
    for (axis, &length) in size.iter().enumerate() {
        let source = values.clone();
        let near = |at: usize, d: isize| (at as isize + d).clamp(0, length as isize - 1) as usize;
        let rows_of_values = values.par_chunks_mut(columns).enumerate();
        rows_of_values.for_each(|(row, blurred)| {
            if axis == 0 {
                let source = &source[row * columns..][..columns];
                for (at, value) in blurred.iter_mut().enumerate() {
                    let near = (-REACH..=REACH).map(|d| source[near(at, d)]);
                    *value = near.zip(&weights).map(|(value, w)| w * value).sum();
                }
                return;
            }
            blurred.fill(0.0);
            for (d, w) in (-REACH..=REACH).zip(&weights) {
                let row = match axis {
                    1 => row / rows * rows + near(row % rows, d),
                    _ => near(row / rows, d) * rows + row % rows,
                };
                for (value, near) in blurred.iter_mut().zip(&source[row * columns..]) {
                    *value += w * near;
                }
            }
        });
    }
    values
}
