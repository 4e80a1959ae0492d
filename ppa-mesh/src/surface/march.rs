//! Marching through layers of cells with the numbers of two slices in memory.

use nalgebra::Vector3;

use super::cell::{CONFIGURATIONS, Configuration, inside_joined};
use super::cells::CellRow;
use super::field::{Field, Sample};
use super::inside::{InsideBits, ones};
use super::numbers::{AT_VOXEL, EXTRA, Numbers, Slice};
use super::points::{Batch, Points};
use super::shortcut::{EdgePlace, Filling, SHORTCUTS, Shortcut, is_crossed};
use super::tunnel;
use super::world::World;

/// Vertices and triangles of some layers of cells, in the world.
#[derive(Default)]
pub struct Part {
    /// Vertices by the kinds of [`super::numbers`].
    pub crossings: Points,
    pub at_voxels: Points,
    pub extra: Points,
    /// Vertex numbers; those after the part's own are the first of the next part.
    pub triangles: Vec<[u32; 3]>,
    /// The triangles that have vertices other than crossings.
    pub marked: Vec<usize>,
}

/// State of the march.
pub struct March<'a, T> {
    pub field: &'a Field<'a, T>,
    pub world: &'a World,
    shortcuts: &'static [Shortcut; 256],
    pub batch: Batch,
    /// Crossings numbered so far.
    pub crossings: u32,
    /// The slices below and above the layer of cells, and the edges between them.
    slices: [Slice; 2],
    upright: Numbers,
    pub part: Part,
}

impl<'a, T: Sample> March<'a, T> {
    /// Begins at slice `start`, with room for `room` crossings. `inside` has the slices on both sides of it.
    pub fn new(
        field: &'a Field<'a, T>,
        inside: &InsideBits<T>,
        world: &'a World,
        start: usize,
        room: usize,
    ) -> Self {
        let mut march = March {
            field,
            world,
            shortcuts: &SHORTCUTS,
            batch: Batch::new(),
            crossings: 0,
            slices: Default::default(),
            upright: Numbers::default(),
            part: Part {
                crossings: Points::with_capacity(room),
                // Euler: a closed surface without handles has fewer than twice as many triangles as vertices.
                triangles: Vec::with_capacity(2 * room),
                ..Part::default()
            },
        };
        let mut low = Slice::default();
        march.voxels(inside, &mut low, start, true);
        march.edges_within(inside, &mut low, start, true);
        march.slices[0] = low;
        march
    }

    /// Marches through the cells between slices k and k + 1; slice k + 1 belongs to the part if it is `own`,
    /// otherwise to the next. `inside` has slice k + 2, if there is one.
    pub fn layer(&mut self, inside: &InsideBits<T>, k: usize, own: bool) {
        let [low, mut high] = std::mem::take(&mut self.slices);
        let mut upright = std::mem::take(&mut self.upright);
        self.voxels(inside, &mut high, k + 1, own);
        self.edges_between(inside, &mut upright, k, [&low, &high]);
        self.edges_within(inside, &mut high, k + 1, own);
        self.cells(inside, k, [&low, &high], &upright);
        self.slices = [high, low];
        self.upright = upright;
    }
}

impl<T: Sample> March<'_, T> {
    /// Stores an extra vertex at a place in voxel indices of the field, with its gradient in HU per voxel step.
    pub fn push(&mut self, place: Vector3<f64>, gradient: Vector3<f32>) -> u32 {
        let id = EXTRA | self.part.extra.vertices.len() as u32;
        self.part.extra.push(self.world, place, gradient);
        id
    }

    fn cells(&mut self, inside: &InsideBits<T>, k: usize, slices: [&Slice; 2], upright: &Numbers) {
        let ny = self.field.size()[1];
        for j in 0..ny - 1 {
            let mut row = CellRow::new(inside, slices, upright, [j, k]);
            for word in 0..inside.words() {
                let corners = row.corners(word);
                let (mut all, mut any) = (u64::MAX, 0);
                for corner in corners {
                    (all, any) = (all & corner, any | corner);
                }
                for bit in ones(any & !all & inside.cells(word)) {
                    let mut configuration = 0;
                    for (corner, word) in corners.iter().enumerate() {
                        configuration |= ((word >> bit & 1) as u8) << corner;
                    }
                    self.cell(&row, [64 * word + bit, j, k], configuration);
                    row.advance(&self.shortcuts[usize::from(configuration)].crossed);
                }
            }
        }
    }

    fn cell(&mut self, row: &CellRow, voxel: [usize; 3], inside: u8) {
        let shortcuts = self.shortcuts;
        match &shortcuts[usize::from(inside)].filling {
            Filling::Triangles(count, triangles) => {
                for &[a, b, c] in &triangles[..*count] {
                    self.triangle([row.id(a), row.id(b), row.id(c)]);
                }
            }
            Filling::Quad(quad) => {
                let [i, j, k] = voxel;
                let [nx, ny, _] = self.field.size();
                let first_voxel = i + nx * (j + ny * k);
                let [p, q, r, s] = quad.ring;
                let (p, q, r, s) = (row.id(p), row.id(q), row.id(r), row.id(s));
                let above = self.field.above_at_corners(first_voxel);
                if quad.first_diagonal_fits_better(&above) {
                    self.triangle([p, q, r]);
                    self.triangle([p, r, s]);
                } else {
                    self.triangle([p, q, s]);
                    self.triangle([q, r, s]);
                }
            }
            Filling::Other => {
                let above = std::array::from_fn(|corner| {
                    let corner = [0, 1, 2].map(|axis| voxel[axis] + (corner >> axis & 1));
                    self.field.above(corner)
                });
                let ids = std::array::from_fn(|edge| match is_crossed(inside, edge as u8) {
                    true => row.id(EdgePlace::new(inside, edge as u8)),
                    false => u32::MAX,
                });
                let configuration = &CONFIGURATIONS[usize::from(inside)];
                self.several_disks(voxel, configuration, &above, &ids);
            }
        }
    }

    /// A cell with several loops or with faces that need the asymptotic decider. `values` are
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
    pub fn triangle(&mut self, triangle: [u32; 3]) {
        let [a, b, c] = triangle;
        if a | b | c >= AT_VOXEL {
            if a == b || b == c || c == a {
                return;
            }
            self.part.marked.push(self.part.triangles.len());
        }
        self.part.triangles.push(triangle);
    }
}
