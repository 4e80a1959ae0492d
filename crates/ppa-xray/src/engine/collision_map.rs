//! Where in the body first collisions happen, and from where they are seen.

use nalgebra::{Point2, Point3, Vector3};
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::engine::attenuation_basis::LANES;
use crate::engine::energy_sampler::EnergySampler;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::matter::scatter_density::ScatterDensities;
use crate::philox::Philox;
use crate::transport::tracking::Transport;

/// Cells along device x and y of the field, and along the rays through the voxel box.
const CELLS: [usize; 3] = [40, 40, 16];

/// Points per side of a cell at which the body is looked at.
const POINTS: usize = 2;

/// Share of the collisions that is drawn without looking at the detector point, so that no weight grows beyond bounds.
const DEFENSIVE: f64 = 0.1;

/// Share of the strength of a neighbour that a cell has at least.
const LENT: f64 = 0.1;

/// Share of the mean strength that a cell has at least: a corner of the body may lie between the points.
const LEAST: f64 = 1e-3;

/// The irradiated part of the box in cells, each with the photons that can be expected to scatter in it.
#[derive(Debug)]
pub(crate) struct CollisionMap {
    cells: Vec<Cell>,
    strength: f64,
    /// Running sums of the strengths.
    sums: Vec<f64>,
    field: Field,
    /// Points of the focal spot and the running sums of their weights.
    spots: Vec<(Point3<f64>, f64)>,
    /// For each spectrum of the emitter.
    pub energies: Vec<EnergySampler>,
    /// Mean energy of the spectrum.
    typical_kev: f64,
    /// What the typical material does to photons of that energy.
    typical: ScatterTable,
}

/// Collisions in a cell, at the typical energy.
#[derive(Debug, Clone, Copy)]
struct Cell {
    middle: Point3<f64>,
    direction: Vector3<f64>,
    strength: f64,
    /// Share of the photons that get here.
    arriving: f64,
}

/// Points per side of a focal spot that is not a point.
const SPOT_POINTS: u32 = 8;

/// A drawn collision.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Collision {
    /// Where the photon leaves the focal spot.
    pub spot: Point3<f64>,
    /// Where the ray meets the detector plane.
    pub aim: Point2<f64>,
    pub direction: Vector3<f64>,
    pub position: Point3<f64>,
    /// Inverse of its probability per mm² of the detector plane and mm of the ray.
    pub mm3: f64,
    /// The cell it lies in.
    pub cell: usize,
}

impl CollisionMap {
    pub fn new(transport: &Transport, paths: &Paths, densities: &[ScatterDensities]) -> Self {
        let typical_kev = transport.spectrum.mean_energy_kev();
        let node = transport.attenuation.locate(typical_kev);
        let scattering: Vec<f64> = (0..densities.len())
            .map(|material| {
                let c = transport.attenuation.at(material as u8, node);
                f64::from(c.total - c.photoelectric)
            })
            .collect();
        let mut map = Self {
            cells: Vec::new(),
            strength: 0.0,
            sums: Vec::new(),
            field: *transport.emitter.field(),
            spots: transport
                .emitter
                .spot_points(SPOT_POINTS)
                .into_iter()
                .scan(0.0, |sum, (spot, weight)| {
                    *sum += weight;
                    Some((spot, *sum))
                })
                .collect(),
            energies: Vec::new(),
            typical_kev,
            typical: typical_scattering(transport, densities, typical_kev),
        };
        let looked: Vec<Look> = (0..CELLS.iter().product::<usize>())
            .into_par_iter()
            .map(|cell| map.look(cell, transport, paths, &scattering))
            .collect();
        let mut mass = vec![[0.0_f32; LANES]; paths.basis.groups];
        let mut strength = 0.0;
        for look in &looked {
            for (sum, before) in mass.iter_mut().flatten().zip(look.mass.iter().flatten()) {
                *sum += before;
            }
            strength += look.cell.strength;
        }
        // The way out is taken to be as long as the way in.
        let twice = 2.0 / strength.max(f64::MIN_POSITIVE) as f32;
        for mean in mass.iter_mut().flatten() {
            *mean *= twice;
        }
        map.energies = transport
            .emitter
            .spectra()
            .iter()
            .map(|spectrum| EnergySampler::new(spectrum, paths, &mass))
            .collect();
        map.cells = looked.into_iter().map(|look| look.cell).collect();
        map.lend();
        let mean = map.cells.iter().map(|cell| cell.strength).sum::<f64>() / map.cells.len() as f64;
        for cell in &mut map.cells {
            cell.strength = cell.strength.max(LEAST * mean).max(f64::MIN_POSITIVE);
        }
        map.sums = map
            .cells
            .iter()
            .scan(0.0, |sum, cell| {
                *sum += cell.strength;
                Some(*sum)
            })
            .collect();
        map.strength = map.sums[map.sums.len() - 1];
        map
    }

    /// Gives every cell a share of what its strongest neighbour has: between the points a cell was looked at may lie
    /// as much.
    fn lend(&mut self) {
        let own: Vec<f64> = self.cells.iter().map(|cell| cell.strength).collect();
        for (index, cell) in self.cells.iter_mut().enumerate() {
            let [i, j, k] = split(index);
            let near = |at: usize, axis: usize| at.saturating_sub(1)..(at + 2).min(CELLS[axis]);
            for row in near(j, 1) {
                for column in near(i, 0) {
                    for depth in near(k, 2) {
                        let neighbour = own[(row * CELLS[0] + column) * CELLS[2] + depth];
                        cell.strength = cell.strength.max(LENT * neighbour);
                    }
                }
            }
        }
    }

    /// Strength of a cell.
    fn look(&self, cell: usize, transport: &Transport, paths: &Paths, scattering: &[f64]) -> Look {
        let mut mass = vec![[0.0; LANES]; paths.basis.groups];
        let mut sum_of_mass = mass.clone();
        let (mut strength, mut bare, mut moment) = (0.0, 0.0, Vector3::zeros());
        let corner = split(cell);
        for point in 0..POINTS.pow(3) {
            let inside = [point, point / POINTS, point / (POINTS * POINTS)]
                .map(|i| ((i % POINTS) as f64 + 0.5) / POINTS as f64);
            let collision = self.place(corner, inside, &Point3::origin(), transport, paths);
            let Some(voxel) = paths.voxel_at(&collision.position) else {
                continue;
            };
            let material = usize::from(transport.phantom.material()[voxel]);
            let density = f64::from(transport.phantom.density_g_cm3()[voxel]);
            let mut here = density * scattering[material] * collision.mm3;
            bare += here;
            if density > 0.05 {
                paths.coarse_between(&Point3::origin(), &collision.position, &mut mass);
                here *= f64::from(-paths.basis.exponent(&mass, self.typical_kev)).exp();
                for (sum, mass) in sum_of_mass.iter_mut().flatten().zip(mass.iter().flatten()) {
                    *sum += here as f32 * mass;
                }
            }
            strength += here;
            moment += here * collision.position.coords;
        }
        let centre = self.place(corner, [0.5; 3], &Point3::origin(), transport, paths);
        let middle = if strength > 0.0 {
            Point3::from(moment / strength)
        } else {
            centre.position
        };
        let cell = Cell {
            middle,
            direction: centre.direction,
            strength: strength / POINTS.pow(3) as f64,
            arriving: if bare > 0.0 { strength / bare } else { 1.0 },
        };
        let share = 1.0 / POINTS.pow(3) as f32;
        for sum in sum_of_mass.iter_mut().flatten() {
            *sum *= share;
        }
        Look {
            cell,
            mass: sum_of_mass,
        }
    }

    /// A point of a cell; `mm3` is its volume in mm² of the plane times mm of the ray.
    fn place(
        &self,
        corner: [usize; 3],
        inside: [f64; 3],
        spot: &Point3<f64>,
        transport: &Transport,
        paths: &Paths,
    ) -> Collision {
        let share: [f64; 3] =
            std::array::from_fn(|axis| (corner[axis] as f64 + inside[axis]) / CELLS[axis] as f64);
        let size_mm = self.field.size_mm();
        let aim =
            Point2::from([0, 1].map(|axis| self.field.low_mm[axis] + size_mm[axis] * share[axis]));
        let plane_mm = transport.projection.source_detector_mm;
        let along = Point3::new(aim.x, aim.y, plane_mm) - spot;
        let length_mm = along.norm();
        let direction = along / length_mm;
        let (enter, leave) = paths.inside(spot, &direction, length_mm);
        let volume = size_mm[0] * size_mm[1] * (leave - enter);
        Collision {
            spot: *spot,
            aim,
            direction,
            position: spot + direction * (enter + share[2] * (leave - enter)),
            mm3: volume / CELLS.iter().product::<usize>() as f64,
            cell: (corner[1] * CELLS[0] + corner[0]) * CELLS[2] + corner[2],
        }
    }

    /// Running sums over the cells of what each can be expected to send to `target`, for [`CollisionMap::draw`], and the
    /// share of photons that pass from the source to the cell and from there to `target`.
    pub fn aim(
        &self,
        target: &Point3<f64>,
        paths: &Paths,
        mass: &mut [[f32; LANES]],
        sums: &mut Vec<f64>,
        passing: &mut Vec<f64>,
    ) {
        let negligible = 2.0 * LEAST * self.strength / self.cells.len() as f64;
        sums.clear();
        passing.clear();
        sums.extend(self.cells.iter().map(|cell| {
            let sight = target - cell.middle;
            let square = sight.norm_squared();
            let r = square.sqrt();
            let cos = (sight.dot(&cell.direction) / r).clamp(-1.0, 1.0);
            let density = self.typical_density(cos);
            let through = if cell.strength > negligible {
                paths.coarse_between(&cell.middle, target, mass);
                f64::from(-paths.basis.exponent(mass, self.typical_kev)).exp()
            } else {
                1.0
            };
            passing.push(cell.arriving * through);
            cell.strength * density * through * sight.z / (r * square)
        }));
        let sum: f64 = sums.iter().sum();
        let mut total = 0.0;
        for (importance, cell) in sums.iter_mut().zip(&self.cells) {
            total +=
                (1.0 - DEFENSIVE) * *importance / sum + DEFENSIVE * cell.strength / self.strength;
            *importance = total;
        }
    }

    /// Scattering of a gram of the typical material by an angle, mm⁻¹ per g/cm³ and sr.
    #[inline]
    pub fn typical_density(&self, cos_theta: f64) -> f64 {
        let scattering = self.typical.at(ScatterTable::locate(cos_theta));
        scattering.compton + scattering.rayleigh
    }

    /// A collision drawn by the running sums of [`CollisionMap::aim`], or for no detector point in particular; `point` is
    /// uniform in the unit cube.
    #[inline]
    pub fn draw(
        &self,
        [v, u, w]: [f64; 3],
        sums: Option<&[f64]>,
        transport: &Transport,
        paths: &Paths,
        rng: &mut Philox,
    ) -> Collision {
        let sums = sums.unwrap_or(&self.sums);
        let spot = match self.spots.as_slice() {
            [(only, _)] => only,
            spots => {
                let lot = rng.unit();
                let index = spots.partition_point(|&(_, sum)| sum <= lot);
                &spots[index.min(spots.len() - 1)].0
            }
        };
        // Row by row, then cell by cell in the row, then along the ray.
        let [columns, rows, depths] = CELLS;
        let total = sums[sums.len() - 1];
        let row = Step::find(sums, columns * depths, 0..rows, v * total);
        let column = Step::find(
            sums,
            depths,
            row.index * columns..(row.index + 1) * columns,
            row.low + u * row.size,
        );
        let depth = Step::find(
            sums,
            1,
            column.index * depths..(column.index + 1) * depths,
            column.low + w * column.size,
        );
        let inside = [column.inside, row.inside, depth.inside];
        let mut collision = self.place(split(depth.index), inside, spot, transport, paths);
        collision.mm3 *= total / depth.size;
        collision
    }
}

/// Scattering by the material that there is most of.
fn typical_scattering(
    transport: &Transport,
    densities: &[ScatterDensities],
    energy_kev: f64,
) -> ScatterTable {
    let phantom = transport.phantom;
    let mut mass_of = vec![0.0; densities.len()];
    for (&material, &density) in phantom.material().iter().zip(phantom.density_g_cm3()) {
        mass_of[usize::from(material)] += f64::from(density);
    }
    let most = (0..mass_of.len())
        .max_by(|&a, &b| mass_of[a].total_cmp(&mass_of[b]))
        .unwrap_or(0);
    let node = transport.attenuation.locate(energy_kev);
    let c = transport.attenuation.at(most as u8, node);
    ScatterTable::new(&densities[most], &transport.samplers[most], energy_kev, &c)
}

/// What a cell holds.
struct Look {
    cell: Cell,
    /// Mass between source and cell, times the strength.
    mass: Vec<[f32; LANES]>,
}

/// Column, row and depth of a cell.
fn split(cell: usize) -> [usize; 3] {
    let [columns, _, depths] = CELLS;
    [
        cell / depths % columns,
        cell / (depths * columns),
        cell % depths,
    ]
}

/// An entry of running sums in strides.
struct Step {
    index: usize,
    low: f64,
    size: f64,
    inside: f64,
}

impl Step {
    /// The entry among `range` that holds `target`; entry i ends with the sum at (i + 1) · stride − 1.
    #[inline]
    fn find(sums: &[f64], stride: usize, range: std::ops::Range<usize>, target: f64) -> Self {
        let end = |index: usize| sums[(index + 1) * stride - 1];
        let (mut first, mut last) = (range.start, range.end - 1);
        while first < last {
            let middle = (first + last) / 2;
            if end(middle) <= target {
                first = middle + 1;
            } else {
                last = middle;
            }
        }
        let low = if first == 0 { 0.0 } else { end(first - 1) };
        let size = end(first) - low;
        Self {
            index: first,
            low,
            size,
            inside: ((target - low) / size).clamp(0.0, 1.0),
        }
    }
}
