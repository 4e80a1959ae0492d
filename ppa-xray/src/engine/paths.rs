//! Line integrals of mass through the voxels, and through coarser cells: Siddon, Med. Phys. 12 (1985) 252.
//!
//! A path goes from cell to cell. Cells are the voxels themselves or, if the density is trilinear, the boxes between eight centres.
//!
//! docs/physics.md, "Fast engine", primary.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::{AttenuationBasis, BasisMass, LANES, add, dot};
use crate::engine::cell_walk::{Step, walk};
use crate::engine::coarse_cells::CoarseCells;
use crate::engine::path_tables::PathTables;
use crate::engine::trilinear::corner_lengths;
use crate::engine::uniform_blocks::{EDGE, UniformBlocks};
use crate::phantom::interpolation::Interpolation;
use crate::phantom::lattice::{Lattice, Ray};
use crate::transport::tracking::Transport;
use crate::transport::voxel_codes::{VoxelCode, VoxelCodes};

/// Paths through a phantom, in the device frame.
pub(crate) struct Paths<'a> {
    codes: &'a VoxelCodes,
    interpolation: Interpolation,
    lattice: &'a Lattice,
    pub basis: Arc<AttenuationBasis>,
    coarse: Arc<CoarseCells>,
    blocks: Arc<UniformBlocks>,
}

impl<'a> Paths<'a> {
    pub fn new(transport: &'a Transport<'a>) -> Self {
        Self::with_tables(transport, PathTables::new(&transport.tables))
    }

    /// The same as [`Paths::new`], with tables shared by several exposures.
    pub fn with_tables(transport: &'a Transport<'a>, tables: PathTables) -> Self {
        let PathTables {
            basis,
            coarse,
            blocks,
        } = tables;
        Self {
            codes: &transport.tables.codes,
            interpolation: transport.tables.phantom.interpolation(),
            lattice: &transport.lattice,
            basis,
            coarse,
            blocks,
        }
    }

    /// The same as [`Paths::new`], with at most `cells` coarse cells.
    #[cfg(test)]
    pub fn with_coarse_cells(transport: &'a Transport<'a>, cells: usize) -> Self {
        let tables = PathTables::with_coarse_cells(&transport.tables, cells);
        Self::with_tables(transport, tables)
    }

    /// Whether the coarse cells are single voxels.
    pub fn coarse_is_exact(&self) -> bool {
        self.coarse.edge == 1
    }

    /// A point in cells from the corner of the box, if it is in the box.
    #[inline]
    pub fn cell_at(&self, point: &Point3<f64>) -> Option<Vector3<f64>> {
        let cell = self.lattice.ray(point, &Vector3::zeros()).origin;
        let size = self.lattice.size;
        let inside = (0..3).all(|axis| cell[axis] >= 0.0 && cell[axis] < size[axis] as f64);
        inside.then_some(cell)
    }

    /// The voxel at a point, if it is in the box.
    #[inline]
    pub fn voxel_at(&self, point: &Point3<f64>) -> Option<usize> {
        let size = self.lattice.size;
        self.cell_at(point).map(|cell| {
            let [i, j, k] = [0, 1, 2].map(|axis| cell[axis] as usize);
            i + size[0] * (j + size[1] * k)
        })
    }

    /// Device z, mm, below which all blocks are uniform air; infinite if all blocks are.
    pub fn nearest_z_mm(&self) -> f64 {
        let z = self.lattice.device_from_cell().row(2).into_owned();
        let along = [0, 1, 2].map(|axis| z[axis]);
        let nearest_corner: f64 = along.iter().map(|mm| EDGE as f64 * mm.min(0.0)).sum();
        let before = cells_before(self.interpolation);
        let blocks = self.blocks.denser_than_air();
        blocks
            .map(|first| {
                let first = first.map(|cell| cell as f64 - before);
                z[3] + first
                    .iter()
                    .zip(along)
                    .map(|(cell, mm)| cell * mm)
                    .sum::<f64>()
            })
            .fold(f64::INFINITY, f64::min)
            + nearest_corner
    }

    /// The part of a path of `length_mm` inside the box; an empty range if there is none.
    pub fn inside(
        &self,
        from: &Point3<f64>,
        direction: &Vector3<f64>,
        length_mm: f64,
    ) -> (f64, f64) {
        let ray = self.lattice.ray(from, direction);
        self.lattice
            .clip(&ray)
            .map_or((0.0, 0.0), |(enter, leave)| {
                (enter.min(length_mm), leave.min(length_mm))
            })
    }

    /// Adds the masses on a path of `length_mm` along a unit vector: uniform blocks in one step each, everything else cell by cell.
    #[inline(always)]
    fn add_path(
        &self,
        from: &Point3<f64>,
        direction: &Vector3<f64>,
        length_mm: f64,
        interpolation: Interpolation,
        mass: &mut BasisMass,
    ) {
        let in_box = self.lattice.ray(from, direction);
        let Some((enter, leave)) = self.lattice.clip(&in_box) else {
            return;
        };
        let end = leave.min(length_mm);
        let ray = cells(in_box, interpolation);
        // Start of the mixed blocks that have not been walked through yet.
        let mut mixed_mm = None;
        let in_blocks = cells(in_box, self.interpolation).shrunk(EDGE);
        let _ = walk(
            &in_blocks,
            self.blocks.size,
            enter,
            end,
            |block, from_mm, to_mm| {
                let Some(code) = self.blocks.code(block) else {
                    mixed_mm.get_or_insert(from_mm);
                    return Step::Continue(());
                };
                if let Some(start_mm) = mixed_mm.take() {
                    self.add_cells(&ray, start_mm, from_mm, interpolation, mass);
                }
                self.add_code(mass, code, (to_mm - from_mm) as f32);
                Step::Continue(())
            },
        );
        if let Some(start_mm) = mixed_mm {
            self.add_cells(&ray, start_mm, end, interpolation, mass);
        }
    }

    /// Adds the masses between two lengths on a ray, cell by cell.
    #[inline(always)]
    fn add_cells(
        &self,
        ray: &Ray,
        from_mm: f64,
        to_mm: f64,
        interpolation: Interpolation,
        mass: &mut BasisMass,
    ) {
        let size = self.codes.size();
        let codes = self.codes.all();
        match interpolation {
            Interpolation::Nearest => {
                let _ = walk(ray, size, from_mm, to_mm, |voxel, from_mm, to_mm| {
                    self.add_code(mass, codes[voxel], (to_mm - from_mm) as f32);
                    Step::Continue(())
                });
            }
            Interpolation::Trilinear => {
                let (row, layer) = (size[0], size[0] * size[1]);
                let last = codes.len() - (1 + row + layer) - 1;
                let _ = walk(ray, size, from_mm, to_mm, |voxel, from_mm, to_mm| {
                    let lengths = corner_lengths(ray, from_mm, to_mm);
                    // Rounding may lead slightly beyond the last cell.
                    let voxel = voxel.min(last);
                    let mut corners = [(VoxelCode::default(), 0.0); 8];
                    for (side, offset) in [0, row, layer, row + layer].into_iter().enumerate() {
                        let pair = &codes[voxel + offset..][..2];
                        corners[2 * side] = (pair[0], lengths[2 * side]);
                        corners[2 * side + 1] = (pair[1], lengths[2 * side + 1]);
                    }
                    self.add_corners(mass, &corners);
                    Step::Continue(())
                });
            }
        }
    }

    /// Adds lengths in eight materials. Two sums are independent of each other, and the mass is accessed once. Uses loops, since
    /// closures over the corners are not always inlined here.
    #[inline(always)]
    fn add_corners(&self, mass: &mut BasisMass, corners: &[(VoxelCode, f32); 8]) {
        for (group, mass) in mass.iter_mut().enumerate() {
            let mut sums = [[0.0_f32; LANES]; 2];
            for (corner, (code, length_mm)) in corners.iter().enumerate() {
                let shares = &self.basis.shares(code.material())[group];
                let amount = code.density_g_cm3() * length_mm;
                for lane in 0..LANES {
                    sums[corner % 2][lane] += shares[lane] * amount;
                }
            }
            for lane in 0..LANES {
                mass[lane] += sums[0][lane] + sums[1][lane];
            }
        }
    }

    /// Adds a length in a material.
    #[inline(always)]
    fn add_code(&self, mass: &mut BasisMass, code: VoxelCode, length_mm: f32) {
        let shares = self.basis.shares(code.material());
        add(mass, shares, code.density_g_cm3() * length_mm);
    }

    /// Calls `visit(cell, from_mm, to_mm)` for each piece of a path through a coarse cell, until `visit` ends it.
    #[inline]
    pub fn coarse_pieces(
        &self,
        from: &Point3<f64>,
        direction: &Vector3<f64>,
        length_mm: f64,
        visit: impl FnMut(usize, f64, f64) -> Step,
    ) {
        let ray = self.lattice.ray(from, direction);
        if let Some((enter, leave)) = self.lattice.clip(&ray) {
            let ray = ray.shrunk(self.coarse.edge);
            let _ = walk(&ray, self.coarse.size, enter, leave.min(length_mm), visit);
        }
    }

    /// Adds a piece through a coarse cell to the masses.
    #[inline(always)]
    pub fn add_coarse(&self, mass: &mut BasisMass, cell: usize, length_mm: f64) {
        add(mass, self.coarse_density(cell), length_mm as f32);
    }

    /// Density of every basis material in a coarse cell, g/cm³.
    #[inline(always)]
    pub fn coarse_density(&self, cell: usize) -> &BasisMass {
        let groups = self.basis.groups;
        &self.coarse.density[cell * groups..(cell + 1) * groups]
    }

    /// Attenuation of the coarse cells at an energy, 1/mm.
    pub fn coarse_exponents(&self, energy_kev: f64) -> Vec<f32> {
        let attenuation = self.basis.at(energy_kev);
        let cells = self.coarse.density.par_chunks(self.basis.groups);
        cells.map(|cell| dot(cell, &attenuation)).collect()
    }

    /// Masses from one point to another.
    pub fn between(&self, from: &Point3<f64>, to: &Point3<f64>, mass: &mut BasisMass) {
        self.sum_path(from, to, self.interpolation, mass);
    }

    /// Masses from one point to another through homogeneous voxels, regardless of the interpolation between their centres; the average over
    /// paths is the same.
    pub fn between_in_voxels(&self, from: &Point3<f64>, to: &Point3<f64>, mass: &mut BasisMass) {
        self.sum_path(from, to, Interpolation::Nearest, mass);
    }

    fn sum_path(
        &self,
        from: &Point3<f64>,
        to: &Point3<f64>,
        interpolation: Interpolation,
        mass: &mut BasisMass,
    ) {
        let (direction, length_mm) = towards(from, to);
        self.gather(mass, |mass| match interpolation {
            // One copy of the walk for each.
            Interpolation::Nearest => {
                self.add_path(from, &direction, length_mm, Interpolation::Nearest, mass);
            }
            Interpolation::Trilinear => {
                self.add_path(from, &direction, length_mm, Interpolation::Trilinear, mass);
            }
        });
    }

    /// Masses from one point to another through the coarse cells.
    #[inline]
    pub fn coarse_between(&self, from: &Point3<f64>, to: &Point3<f64>, mass: &mut BasisMass) {
        let (direction, length_mm) = towards(from, to);
        self.gather(mass, |mass| {
            self.coarse_pieces(from, &direction, length_mm, |cell, from_mm, to_mm| {
                self.add_coarse(mass, cell, to_mm - from_mm);
                Step::Continue(())
            });
        });
    }

    /// Sums into registers if there is one group.
    #[inline(always)]
    fn gather(&self, mass: &mut BasisMass, mut sum: impl FnMut(&mut BasisMass)) {
        if let [mass] = mass {
            let mut single = [[0.0; LANES]];
            sum(&mut single);
            *mass = single[0];
        } else {
            mass.fill([0.0; LANES]);
            sum(mass);
        }
    }
}

/// Converts a ray of the box to cells of the codes, counted from the corner of the rim, or from the centre of the voxel there.
#[inline(always)]
fn cells(in_box: Ray, interpolation: Interpolation) -> Ray {
    Ray {
        origin: in_box.origin.add_scalar(cells_before(interpolation)),
        ..in_box
    }
}

/// Number of cells of the codes before the corner of the box.
#[inline(always)]
fn cells_before(interpolation: Interpolation) -> f64 {
    match interpolation {
        Interpolation::Nearest => 1.0,
        Interpolation::Trilinear => 0.5,
    }
}

#[inline(always)]
fn towards(from: &Point3<f64>, to: &Point3<f64>) -> (Vector3<f64>, f64) {
    let along = to - from;
    let length_mm = along.norm();
    (along / length_mm, length_mm)
}

#[cfg(test)]
mod tests;
