//! Marching through a few layers of cells with the crossings of two slices in memory.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::cell::{CONFIGURATIONS, Configuration, inside_joined};
use super::cell_row::CellRow;
use super::crossings::Slice;
use super::field::{Field, Sample};
use super::inside::{InsideBits, ones};
use super::shortcut::{SHORTCUTS, Shortcut};
use super::tunnel;
use super::world::World;

/// Marks a vertex of the first slice of the slab above.
pub const NEXT_SLAB: u32 = 1 << 31;

/// Vertices and triangles of some layers of cells, in the world.
#[derive(Default)]
pub struct Slab {
    pub vertices: Vec<Point3<f32>>,
    /// Unit vectors, or zero where the gradient vanishes.
    pub normals: Vec<Vector3<f32>>,
    /// Own vertices, or those of the next slab's first slice marked by [`NEXT_SLAB`].
    pub triangles: Vec<[u32; 3]>,
}

/// The march with what it has made so far.
pub struct March<'a, T> {
    pub field: &'a Field<'a, T>,
    pub inside: InsideBits,
    pub world: &'a World,
    shortcuts: &'static [Shortcut],
    slab: Slab,
}

/// Surface within the layers of cells between slices k and k + 1 for k in `layers`; samples are inside
/// from `first_inside` on.
pub fn march<T: Sample>(
    field: &Field<T>,
    world: &World,
    first_inside: T,
    layers: Range<usize>,
) -> Slab {
    let [nx, ny, nz] = field.size();
    let slices = layers.start.saturating_sub(1)..(layers.end + 2).min(nz);
    let mut march = March {
        field,
        inside: InsideBits::of(field, slices, first_inside),
        world,
        shortcuts: &SHORTCUTS,
        slab: Slab::default(),
    };
    let [mut low, mut high] = [0, 1].map(|_| Slice::new(nx * ny));
    let mut upright = vec![0; nx * ny];
    march.number(&mut low, layers.start, 0, true);
    for k in layers.clone() {
        // The slice on top belongs to the slab above, if there is one; its numbers start at 0.
        let own = k + 1 < layers.end || k + 2 == nz;
        let first = if own {
            march.slab.vertices.len() as u32
        } else {
            NEXT_SLAB
        };
        march.number(&mut high, k + 1, first, own);
        march.number_upright(&mut upright, k, &low, &high);
        march.layer(k, [&low, &high], &upright);
        std::mem::swap(&mut low, &mut high);
    }
    march.slab
}

impl<T: Sample> March<'_, T> {
    /// Stores a vertex at a place in voxel indices of the field, with its gradient in HU per voxel step.
    pub fn push(&mut self, place: Vector3<f64>, gradient: Vector3<f32>) -> u32 {
        let id = self.slab.vertices.len() as u32;
        self.slab.vertices.push(self.world.point(place));
        self.slab.normals.push(self.world.normal(gradient));
        id
    }

    fn layer(&mut self, k: usize, slices: [&Slice; 2], upright: &[u32]) {
        let ny = self.field.size()[1];
        let inside = std::mem::take(&mut self.inside);
        for j in 0..ny - 1 {
            let row = CellRow::new(self.field, &inside, slices, upright, [j, k]);
            for word in 0..inside.words() {
                let corners = row.corners(word);
                let (mut all, mut any) = (u64::MAX, 0);
                for corner in corners {
                    (all, any) = (all & corner, any | corner);
                }
                for bit in ones(any & !all & inside.cells(word)) {
                    let mut configuration = 0;
                    for (corner, word) in corners.iter().enumerate() {
                        configuration |= ((word >> bit & 1) as usize) << corner;
                    }
                    self.cell(&row, [64 * word + bit, j, k], configuration);
                }
            }
        }
        self.inside = inside;
    }

    fn cell(&mut self, row: &CellRow<T>, voxel: [usize; 3], inside: usize) {
        let ids = row.ids(voxel[0]);
        // Written out where nearly all cells pass: arrays mapped by closures are not inlined here.
        let id = |edge: u8| ids[usize::from(edge)];
        match &self.shortcuts[inside] {
            Shortcut::Triangles(count, triangles) => {
                for &[a, b, c] in &triangles[..*count] {
                    self.triangle([id(a), id(b), id(c)]);
                }
            }
            Shortcut::Quad(quad) => {
                let iso = self.field.iso();
                let mut above = row.hu(voxel[0]);
                for hu in &mut above {
                    *hu -= iso;
                }
                let [p, q, r, s] = quad.ring;
                let (p, q, r, s) = (id(p), id(q), id(r), id(s));
                if quad.first_diagonal_fits_better(&above) {
                    self.triangle([p, q, r]);
                    self.triangle([p, r, s]);
                } else {
                    self.triangle([p, q, s]);
                    self.triangle([q, r, s]);
                }
            }
            Shortcut::None => {
                let iso = f64::from(self.field.iso());
                let above = row.hu(voxel[0]).map(|hu| f64::from(hu) - iso);
                self.several_disks(voxel, &CONFIGURATIONS[inside], &above, &ids);
            }
        }
    }

    /// A cell with several loops or with faces that the asymptotic decider has to look at. `values` are
    /// HU above iso; exact for the usual HU, so that both cells at a face decide alike.
    fn several_disks(
        &mut self,
        voxel: [usize; 3],
        configuration: &Configuration,
        values: &[f64; 8],
        ids: &[u32; 12],
    ) {
        let id = |edge: u8| ids[usize::from(edge)];
        let mut decisions = 0;
        for (bit, &face) in configuration.ambiguous.iter().enumerate() {
            decisions |= usize::from(inside_joined(face, values)) << bit;
        }
        let pattern = &configuration.patterns[decisions];
        // Voxels at the iso value merge vertices of a ring; extra vertices could then lie on its sides.
        let distinct = |ring: &[u8]| {
            let mut ids: Vec<u32> = ring.iter().map(|&edge| id(edge)).collect();
            ids.sort_unstable();
            ids.dedup();
            ids.len()
        };
        let mut tube = tunnel::tube(configuration, decisions, pattern, values);
        if let Some(pair) = tube {
            let [first, second] = pair.map(|at| pattern.disks[at].ring.as_slice());
            match tunnel::tube_triangles(first, second) {
                Some(triangles) => triangles.iter().for_each(|t| self.triangle(t.map(id))),
                None if distinct(first) < first.len() || distinct(second) < second.len() => {
                    tube = None;
                }
                None => {
                    let rings = [first, second].map(|ring| ring.iter().map(|&e| id(e)).collect());
                    self.waist(voxel, [first, second], rings);
                }
            }
        }
        for (at, disk) in pattern.disks.iter().enumerate() {
            if tube.is_some_and(|pair| pair.contains(&at)) {
                continue;
            }
            if disk.triangles.is_empty() && distinct(&disk.ring) >= 3 {
                let ring: Vec<u32> = disk.ring.iter().map(|&edge| id(edge)).collect();
                let (position, gradient) = self.middle(voxel, &disk.ring);
                let middle = self.push(position, gradient);
                for at in 0..ring.len() {
                    self.triangle([ring[at], ring[(at + 1) % ring.len()], middle]);
                }
            }
            for triangle in &disk.triangles {
                self.triangle(triangle.map(id));
            }
        }
    }

    /// Stores a triangle unless voxels at the iso value have merged two of its corners.
    pub fn triangle(&mut self, [a, b, c]: [u32; 3]) {
        if a != b && b != c && c != a {
            let turned = if self.world.mirrored {
                [a, c, b]
            } else {
                [a, b, c]
            };
            self.slab.triangles.push(turned);
        }
    }
}
