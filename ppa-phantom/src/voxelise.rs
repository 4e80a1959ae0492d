//! Conversion of shapes to Hounsfield units on a lattice, with partial volume.

use nalgebra::{Point3, Vector3};
use ppa_core::Side;
use rayon::prelude::*;

use ppa_ct::Grid;
use ppa_ct::with_room;
use ppa_ct::{Volume, VolumeError};

use super::contents::{Local, Near};
use super::limb::Limb;

/// Why a phantom cannot be voxelised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhantomError {
    /// The spacing is not a number in the supported range.
    #[error("voxels of {found_mm} mm, expected {} to {} mm", SPACING_MM[0], SPACING_MM[1])]
    Spacing {
        /// Spacing asked for, mm.
        found_mm: f64,
    },
    /// Blur or noise of a scanner outside the supported range.
    #[error("{what} of {found}, expected 0 to {most}")]
    Scanner {
        /// Name of the invalid quantity.
        what: &'static str,
        /// Value asked for.
        found: f64,
        /// Largest supported value.
        most: f64,
    },
    /// The lattice or its values are invalid.
    #[error(transparent)]
    Volume(#[from] VolumeError),
}

/// Whether the limb lies on a table top.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TableTop {
    /// Only the limb, in air.
    Absent,
    /// A flat sandwich of carbon fibre and foam, 30 mm thick, which heel and calf touch; it extends beyond the
    /// field of view on four sides.
    Present,
}

const SPACING_MM: [f64; 2] = [0.25, 8.0];
/// Largest number of voxels of a phantom: 2 GiB of values, which a lower leg reaches at 0.4 mm.
const MOST_VOXELS: f64 = 536_870_912.0;
const AIR_HU: f64 = -1000.0;
/// Width of the air around the limb inside the field of view.
const MARGIN_MM: f64 = 12.0;
/// Thickness of the complete table top and of each of its two carbon sheets.
const TABLE_MM: f64 = 30.0;
const TABLE_SHEET_MM: f64 = 2.0;
const TABLE_SHEET_HU: f64 = -150.0;
const TABLE_FOAM_HU: f64 = -940.0;
/// Edge of the blocks that are tested together, voxels.
const BLOCK: usize = 4;
/// Safety factor: distances are estimates.
const CAUTION: f64 = 1.3;
/// Largest part of a voxel in which boundaries are taken as flat, mm; larger voxels are divided.
const FLAT_MM: f64 = 1.0;

/// Fraction of `y ± half` that is between `low` and `high`.
fn share_between(y: f64, half: f64, low: f64, high: f64) -> f64 {
    (((y + half).min(high) - (y - half).max(low)) / (2.0 * half)).max(0.0)
}

/// Mean Hounsfield unit at height `y_mm` outside the limb.
fn background_hu(y_mm: f64, half_mm: f64, table_top_mm: Option<f64>) -> f64 {
    let Some(top) = table_top_mm else {
        return AIR_HU;
    };
    let table = share_between(y_mm, half_mm, top, top + TABLE_MM);
    let foam = share_between(
        y_mm,
        half_mm,
        top + TABLE_SHEET_MM,
        top + TABLE_MM - TABLE_SHEET_MM,
    );
    AIR_HU + foam * (TABLE_FOAM_HU - AIR_HU) + (table - foam) * (TABLE_SHEET_HU - AIR_HU)
}

impl Limb {
    /// Returns the phantom as a CT with isotropic voxels, axes along LPS.
    ///
    /// The field of view contains the limb with some air around it, and cuts a leg at mid-calf.
    /// Every tissue contributes its share of a voxel. The share follows from the distance to the boundary, taken as
    /// flat; voxels above 1 mm that a boundary may cross are first divided into parts. The result does not
    /// depend on the number of threads.
    ///
    /// # Errors
    /// [`PhantomError::Spacing`] when `spacing_mm` is not between 0.25 and 8, [`VolumeError::TooFine`] when it gives
    /// more than 2^29 voxels, [`VolumeError::Memory`] when they do not fit in memory.
    pub fn voxelise(&self, spacing_mm: f64, table: TableTop) -> Result<Volume, PhantomError> {
        let (mut low, mut high) = self.skin_box();
        low -= Vector3::repeat(MARGIN_MM);
        high += Vector3::new(MARGIN_MM, MARGIN_MM, 0.0);
        if let Some(distal) = self.scan.cut[0] {
            low.z = self.ct_from_limb.translation.z + distal;
        }
        if table == TableTop::Present {
            high.y = self.table_top_y + TABLE_MM + MARGIN_MM;
        }
        self.voxelise_right([low, high], spacing_mm, table)
    }

    /// Returns the part of the phantom in a world box (`ct`, mm), as in [`Limb::voxelise`]: the first voxel is centred
    /// on the lowest corner; on a left limb on the corner that is highest in x and lowest in y and z.
    ///
    /// # Errors
    /// The same as [`Limb::voxelise`]; [`PhantomError::Volume`] when the box is empty.
    pub fn voxelise_box(
        &self,
        [low, high]: [Point3<f64>; 2],
        spacing_mm: f64,
        table: TableTop,
    ) -> Result<Volume, PhantomError> {
        let (a, b) = (self.on_right(low), self.on_right(high));
        let (low, high) = if self.side == Side::Left {
            (Point3::new(b.x, a.y, a.z), Point3::new(a.x, b.y, b.z))
        } else {
            (a, b)
        };
        self.voxelise_right([low, high], spacing_mm, table)
    }

    /// Voxels in a box of the right limb's `ct`, mirrored if this is the left one.
    fn voxelise_right(
        &self,
        [low, high]: [Point3<f64>; 2],
        spacing_mm: f64,
        table: TableTop,
    ) -> Result<Volume, PhantomError> {
        if !(SPACING_MM[0]..=SPACING_MM[1]).contains(&spacing_mm) {
            return Err(PhantomError::Spacing {
                found_mm: spacing_mm,
            });
        }
        let counts = ((high - low) / spacing_mm).map(|steps| steps.floor().max(-1.0) + 1.0);
        let voxels = counts.product();
        if voxels > MOST_VOXELS {
            return Err(PhantomError::Volume(VolumeError::TooFine {
                spacing_mm,
                voxels,
                most: MOST_VOXELS,
            }));
        }
        let size = [0, 1, 2].map(|a| counts[a] as usize);
        let spacing = Vector3::repeat(spacing_mm);
        let grid = Grid::axis_aligned(size, spacing, low).map_err(VolumeError::from)?;
        let mut hu = with_room(grid.len())?;
        hu.resize(grid.len(), AIR_HU as f32);
        self.paint_on(&grid, spacing_mm, table, &mut hu);
        if self.side == Side::Right {
            return Ok(Volume::new(grid, hu)?);
        }
        hu.chunks_mut(size[0]).for_each(<[f32]>::reverse);
        let last = grid.centre([(size[0] - 1) as f64, 0.0, 0.0]);
        let mirrored = Grid::axis_aligned(size, spacing, self.on_right(last));
        Ok(Volume::new(mirrored.map_err(VolumeError::from)?, hu)?)
    }

    /// Computes one value per voxel of a lattice in the right limb's `ct`.
    fn paint_on(&self, grid: &Grid, spacing_mm: f64, table: TableTop, hu: &mut [f32]) {
        let table_top_mm = match table {
            TableTop::Absent => None,
            TableTop::Present => Some(self.table_top_y),
        };
        let [nx, ny, nz] = grid.size();
        let slab = nx * ny * BLOCK;
        hu.par_chunks_mut(slab).enumerate().for_each(|(n, hu)| {
            let painter = Painter {
                limb: self,
                grid,
                spacing_mm,
                table_top_mm,
                first_slice: n * BLOCK,
            };
            for j in (0..ny).step_by(BLOCK) {
                for i in (0..nx).step_by(BLOCK) {
                    let low = [i, j, n * BLOCK];
                    let high = [
                        (i + BLOCK).min(nx),
                        (j + BLOCK).min(ny),
                        ((n + 1) * BLOCK).min(nz),
                    ];
                    painter.paint(low, high, hu);
                }
            }
        });
    }
}

/// Fills blocks of voxels of one slab.
struct Painter<'a> {
    limb: &'a Limb,
    grid: &'a Grid,
    spacing_mm: f64,
    table_top_mm: Option<f64>,
    first_slice: usize,
}

impl Painter<'_> {
    fn centre(&self, low: [usize; 3], high: [usize; 3]) -> Point3<f64> {
        self.grid
            .centre([0, 1, 2].map(|a| 0.5 * (low[a] + high[a] - 1) as f64))
    }

    fn paint(&self, low: [usize; 3], high: [usize; 3], hu: &mut [f32]) {
        let limb = self.limb;
        let half = self.spacing_mm * 0.5;
        let extent = Vector3::from_fn(|a, _| (high[a] - low[a]) as f64 * half);
        let radius_mm = extent.norm();
        let centre_ct = self.centre(low, high);
        let centre = limb.limb_from_right(&centre_ct);
        let skin_mm = limb.envelope.skin_distance(&centre);
        let [nx, ny, _] = self.grid.size();
        let slot = |[i, j, k]: [usize; 3]| i + nx * (j + ny * (k - self.first_slice));
        let voxels = (low[2]..high[2])
            .flat_map(|k| (low[1]..high[1]).map(move |j| (j, k)))
            .flat_map(|(j, k)| (low[0]..high[0]).map(move |i| [i, j, k]));

        let reach_mm = CAUTION * radius_mm + 1.0;
        if skin_mm > reach_mm {
            let y = |voxel: [usize; 3]| self.grid.centre(voxel.map(|v| v as f64)).y;
            for voxel in voxels {
                hu[slot(voxel)] = background_hu(y(voxel), half, self.table_top_mm) as f32;
            }
            return;
        }
        let cover_mm = limb.envelope.cover_mm(&centre) + 1.0;
        let near = Near {
            skin: skin_mm > -(CAUTION * radius_mm + cover_mm),
            deep_fat: limb.envelope.deep_fat_distance(&centre) < reach_mm,
            tendon: limb.envelope.tendon_distance(&centre) < reach_mm,
        };
        let bones: Vec<usize> = (0..limb.skeleton.bones().len())
            .filter(|&b| {
                limb.skeleton.box_distance(b, &centre) < radius_mm
                    && limb.skeleton.distance(b, &centre) < reach_mm
            })
            .collect();
        let (mut local, mut part) = (Local::default(), Local::default());
        for voxel in voxels {
            let centre = self.grid.centre(voxel.map(|v| v as f64));
            hu[slot(voxel)] = self.voxel_hu(&centre, near, &bones, [&mut local, &mut part]) as f32;
        }
    }

    fn voxel_hu(
        &self,
        centre: &Point3<f64>,
        near: Near,
        bones: &[usize],
        [local, part]: [&mut Local; 2],
    ) -> f64 {
        let limb = self.limb;
        let p = limb.limb_from_right(centre);
        limb.measure(&p, near.skin, bones.iter().copied(), local);
        let half = 0.5 * self.spacing_mm;
        let background = background_hu(centre.y, half, self.table_top_mm);
        let blend = |(hu, inside): (f64, f64)| hu + (1.0 - inside) * (background - AIR_HU);
        let parts = (self.spacing_mm / FLAT_MM).ceil() as usize;
        let reach_mm = half * 3.0_f64.sqrt() * CAUTION;
        if parts == 1 || !limb.boundary_near(&p, local, reach_mm) {
            return blend(limb.mixture(&p, near, local, self.spacing_mm));
        }
        // Only distances that can change inside the voxel are measured again.
        let near_skin = local
            .skin_mm
            .is_some_and(|skin| skin > -(limb.envelope.cover_mm(&p) + reach_mm));
        local.bones.retain(|&(_, distance)| distance < reach_mm);
        let width_mm = self.spacing_mm / parts as f64;
        let offset = |n: usize| (n as f64 + 0.5) * width_mm - half;
        let mut sum = 0.0;
        for n in 0..parts.pow(3) {
            let shift = Vector3::new(
                offset(n % parts),
                offset(n / parts % parts),
                offset(n / parts.pow(2)),
            );
            let q = limb.limb_from_right(&(centre + shift));
            limb.measure(&q, near_skin, local.bones.iter().map(|b| b.0), part);
            sum += blend(limb.mixture(&q, near, part, width_mm));
        }
        sum / parts.pow(3) as f64
    }
}
