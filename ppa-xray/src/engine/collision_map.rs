//! Importance sampling of the position of the first collision, from a map of cells over the irradiated body.
//!
//! The density is the square root of the summed squared expected contributions to points of the detector, each in units of its
//! tolerance, mixed with the number of scattered photons (defensive sampling): Kahn and Harris, NBS Appl. Math. Ser. 12 (1951) 27;
//! Hesterberg, Technometrics 37 (1995) 185. docs/physics.md, "Fast engine", first collisions.

use nalgebra::{Point2, Point3, Vector3};
use ppa_core::random::Philox;
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::engine::attenuation_basis::{LANES, dot};
use crate::engine::cdf::Entry;
use crate::engine::lines::Lines;
use crate::engine::paths::Paths;
use crate::engine::site::Site;
use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};
use crate::transport::tracking::Transport;
use crate::vector_math::exp;

/// Cells along device x and y of the field, and along the rays through the voxel box.
const CELLS: [usize; 3] = [40, 40, 16];

/// Points per side of a cell at which the body is sampled.
const POINTS: usize = 2;

/// Share of the collisions that are sampled by the number of scattered photons, regardless of importance.
const DEFENSIVE_SHARE: f64 = 0.3;

/// Minimum of a cell as a share of its neighbour.
const NEIGHBOUR_SHARE: f64 = 0.1;

/// Minimum of a cell as a share of the mean: a corner of the body may be between the points.
const LEAST_SHARE: f64 = 1e-3;

/// Cells of the irradiated part of the box.
#[derive(Debug)]
pub(crate) struct CollisionMap {
    /// Cumulative sampling density of the cells.
    sums: Vec<f64>,
    field: Field,
    /// Mean mass on the path in and out.
    pub mass: Vec<[f32; LANES]>,
    /// Mean energy of the photons that pass that mass, keV.
    pub typical_kev: f64,
    /// The cells as single collisions, with the expected number of photons that scatter in each.
    pub cells: Vec<Site>,
}

/// A sampled collision.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Collision {
    /// Point of the focal spot from which the photon starts.
    pub spot: Point3<f64>,
    /// Intersection of the ray with the detector plane.
    pub aim: Point2<f64>,
    pub direction: Vector3<f64>,
    pub position: Point3<f64>,
    /// Inverse of its probability per mm² of the detector plane and mm of the ray.
    pub mm3: f64,
    /// The cell of the collision; neighbours mostly have neighbouring numbers.
    pub cell: usize,
}

impl CollisionMap {
    pub fn new(transport: &Transport, paths: &Paths, lines: &Lines) -> Self {
        let mut map = Self {
            sums: Vec::new(),
            field: *transport.emitter.field(),
            mass: vec![[0.0; LANES]; paths.basis.groups],
            typical_kev: 0.0,
            cells: Vec::new(),
        };
        let samples: Vec<CellSample> = (0..CELLS.iter().product::<usize>())
            .into_par_iter()
            .map(|cell| map.sample(cell, transport, paths, lines))
            .collect();
        let mut weight = 0.0;
        for sample in &samples {
            let before = sample.mass.iter().flatten();
            for (sum, before) in map.mass.iter_mut().flatten().zip(before) {
                *sum += before;
            }
            weight += sample.site.weight;
        }
        // The path out is assumed to be as long as the path in.
        let twice = 2.0 / weight.max(f32::MIN_POSITIVE);
        for mean in map.mass.iter_mut().flatten() {
            *mean *= twice;
        }
        map.typical_kev = mean_energy_behind(lines, &map.mass);
        map.cells = samples.into_iter().map(|sample| sample.site).collect();
        map
    }

    /// Sets the sampling density of the cells from their `importance`, with a share by scattered photons for cells that it underestimates.
    pub fn set_density(&mut self, importance: &[f64]) {
        let mean = |of: &dyn Fn(usize) -> f64| -> f64 {
            (0..self.cells.len())
                .map(of)
                .sum::<f64>()
                .max(f64::MIN_POSITIVE)
                / self.cells.len() as f64
        };
        let weight = |cell: usize| f64::from(self.cells[cell].weight);
        let (important, strong) = (mean(&|cell| importance[cell]), mean(&weight));
        let both: Vec<f64> = (0..self.cells.len())
            .map(|cell| {
                (1.0 - DEFENSIVE_SHARE) * importance[cell] / important
                    + DEFENSIVE_SHARE * weight(cell) / strong
            })
            .collect();
        self.sums = spread_to_neighbours(&both)
            .into_iter()
            .scan(0.0, |sum, density| {
                *sum += density.max(LEAST_SHARE);
                Some(*sum)
            })
            .collect();
    }

    /// Content of a cell.
    fn sample(
        &self,
        cell: usize,
        transport: &Transport,
        paths: &Paths,
        lines: &Lines,
    ) -> CellSample {
        let mut mass = vec![[0.0; LANES]; paths.basis.groups];
        let mut sum_of_mass = mass.clone();
        let (mut weight, mut strongest) = (0.0, 0.0);
        let (mut material, mut moment) = (0, Vector3::zeros());
        for point in 0..POINTS.pow(3) {
            let inside = [point, point / POINTS, point / (POINTS * POINTS)]
                .map(|i| ((i % POINTS) as f64 + 0.5) / POINTS as f64);
            let collision = self.place(split(cell), inside, &Point3::origin(), transport, paths);
            let Some(voxel) = paths.voxel_at(&collision.position) else {
                continue;
            };
            let found = transport.tables.phantom.material()[voxel];
            let density = f64::from(transport.tables.phantom.density_g_cm3()[voxel]);
            mass.fill([0.0; LANES]);
            if density > 0.05 {
                paths.coarse_between(&Point3::origin(), &collision.position, &mut mass);
            }
            let scattered = lines.central_spectrum().map(|(line, photons)| {
                let through = f64::from(exp(-dot(&mass, &line.attenuation)));
                photons * line.scattered[usize::from(found)] * through
            });
            let here = density * collision.mm3 * scattered.sum::<f64>();
            for (sum, mass) in sum_of_mass.iter_mut().flatten().zip(mass.iter().flatten()) {
                *sum += here as f32 * mass;
            }
            weight += here;
            moment += here * collision.position.coords;
            if here > strongest {
                (strongest, material) = (here, found);
            }
        }
        let share = 1.0 / POINTS.pow(3) as f32;
        for sum in sum_of_mass.iter_mut().flatten() {
            *sum *= share;
        }
        let centre = self.place(split(cell), [0.5; 3], &Point3::origin(), transport, paths);
        let middle = if weight > 0.0 {
            Point3::from(moment / weight)
        } else {
            centre.position
        };
        CellSample {
            site: Site {
                position: middle.cast(),
                direction: centre.direction.cast(),
                weight: (weight / POINTS.pow(3) as f64) as f32,
                attenuation_ratio: 1.0,
                material,
            },
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

    /// Samples a collision with the density of [`CollisionMap::set_density`]; the point is uniform in the unit cube.
    #[inline]
    pub fn draw(
        &self,
        [v, u, w]: [f64; 3],
        transport: &Transport,
        paths: &Paths,
        rng: &mut Philox,
    ) -> Collision {
        let sums = &self.sums;
        let spot = transport.emitter.draw_spot(rng);
        // Row by row, then cell by cell in the row, then along the ray.
        let [columns, rows, depths] = CELLS;
        let total = sums[sums.len() - 1];
        let row = Entry::find(sums, columns * depths, 0..rows, v * total);
        let column = Entry::find(
            sums,
            depths,
            row.index * columns..(row.index + 1) * columns,
            row.low + u * row.size,
        );
        let depth = Entry::find(
            sums,
            1,
            column.index * depths..(column.index + 1) * depths,
            column.low + w * column.size,
        );
        let inside = [column.inside, row.inside, depth.inside];
        let mut collision = self.place(split(depth.index), inside, &spot, transport, paths);
        collision.mm3 *= total / depth.size;
        collision
    }
}

/// Gives every cell a share of its strongest neighbour, because there may be as much between the sampled points of a cell.
fn spread_to_neighbours(own: &[f64]) -> Vec<f64> {
    (0..own.len())
        .map(|index| {
            let [i, j, k] = split(index);
            let near = |at: usize, axis: usize| at.saturating_sub(1)..(at + 2).min(CELLS[axis]);
            let mut weight = own[index];
            for row in near(j, 1) {
                for column in near(i, 0) {
                    for depth in near(k, 2) {
                        let neighbour = own[(row * CELLS[0] + column) * CELLS[2] + depth];
                        weight = weight.max(NEIGHBOUR_SHARE * neighbour);
                    }
                }
            }
            weight
        })
        .collect()
}

/// Mean energy of the photons that pass the given masses, keV.
fn mean_energy_behind(lines: &Lines, mass: &[[f32; LANES]]) -> f64 {
    let (mut photons, mut energy) = (f64::MIN_POSITIVE, 0.0);
    for (line, photons_sent) in lines.central_spectrum() {
        let through = photons_sent * f64::from(exp(-dot(mass, &line.attenuation)));
        photons += through;
        energy += through * line.energy_kev;
    }
    (energy / photons).clamp(CUTOFF_KEV, MAX_ENERGY_KEV)
}

/// Content of a cell.
struct CellSample {
    site: Site,
    /// Mass between source and cell, times the weight.
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
