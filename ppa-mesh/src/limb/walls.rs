//! Flat walls across the openings of a skin where faces of the volume cut the limb.
//!
//! The skin ends in the planes of the outermost voxel centres. In each of these planes its boundary edges, with the
//! corners of the rectangle of voxel centres, are triangulated (constrained Delaunay); the triangles inside the limb
//! are the wall. Walls therefore have no vertices of their own except corners of the volume, and move with the skin.

use std::collections::HashSet;
use std::ops::Range;

use nalgebra::{Point3, Vector3};
use ppa_ct::Grid;
use spade::handles::{FixedFaceHandle, FixedVertexHandle, InnerTag};
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::mesh::Mesh;

/// A vertex this close to a plane of voxel centres lies in it, voxels; far above the rounding of positions.
const IN_PLANE: f64 = 1e-3;

/// Names of the faces, in the order of [`CutFace`](super::CutFace).
const FACES: [&str; 6] = ["-i", "+i", "-j", "+j", "-k", "+k"];

/// Flat walls that close a skin where faces of the volume (or of the crop) cut the limb.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CutWalls {
    /// Corners of the volume that lie inside the limb, `ct` frame, mm.
    pub corners: Vec<Point3<f32>>,
    /// Triangles, counter-clockwise seen from outside. They use the vertices of the skin, after which the corners are
    /// numbered.
    pub triangles: Vec<[u32; 3]>,
    /// The walls: the name of each face that cuts the limb, as in [`CutFace`](super::CutFace), and its triangles.
    pub faces: Vec<(&'static str, Range<usize>)>,
}

/// Measures of one wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallMeasure {
    /// The face of the volume: `-i`, `+i`, `-j`, `+j`, `-k` or `+k`.
    pub face: &'static str,
    /// Area, mm².
    pub area_mm2: f64,
    /// Centre of area, in the frame of the skin, mm.
    pub centre: Point3<f64>,
    /// Unit normal, away from the limb.
    pub outward: Vector3<f64>,
}

impl CutWalls {
    /// Walls of an open skin that ends at the border of `grid`.
    pub(super) fn of(grid: &Grid, skin: &Mesh) -> Self {
        let rim = Rim::of(grid, skin);
        let mut walls = Self::default();
        let mut closed: HashSet<[u32; 2]> = HashSet::new();
        let mut add = |face: usize, triangles: Vec<[u32; 3]>, closed: &mut HashSet<[u32; 2]>| {
            let first = walls.triangles.len();
            for [a, b, c] in &triangles {
                closed.extend([[*a, *b], [*b, *c], [*c, *a]]);
            }
            walls.triangles.extend(triangles);
            walls
                .faces
                .push((FACES[face], first..walls.triangles.len()));
        };
        let cut: Vec<usize> = (0..6).filter(|&face| !rim.edges[face].is_empty()).collect();
        for &face in &cut {
            add(face, rim.wall(face), &mut closed);
        }
        // A face entirely inside the limb has no rim, but the walls next to it end at its border.
        let mut whole: Vec<usize> = (0..6).filter(|face| !cut.contains(face)).collect();
        let ends_at = |face: usize, closed: &HashSet<[u32; 2]>| {
            let in_face = |id: &u32| rim.is_in(*id, face);
            let open = |[a, b]: &[u32; 2]| !closed.contains(&[*b, *a]);
            closed
                .iter()
                .any(|edge| edge.iter().all(in_face) && open(edge) && !rim.is_of_skin(*edge))
        };
        while let Some(at) = whole.iter().position(|&face| ends_at(face, &closed)) {
            let face = whole.swap_remove(at);
            add(face, rim.whole_face(face), &mut closed);
        }
        walls.number_corners(skin.vertices.len() as u32, &rim);
        walls
    }

    /// Keeps only the corners that are used.
    fn number_corners(&mut self, vertices: u32, rim: &Rim) {
        let mut numbers = [None; 8];
        for id in self.triangles.as_flattened_mut() {
            let Some(corner) = id.checked_sub(vertices) else {
                continue;
            };
            let number = numbers[corner as usize].get_or_insert_with(|| {
                self.corners.push(rim.corners[corner as usize]);
                self.corners.len() as u32 - 1
            });
            *id = vertices + *number;
        }
    }

    /// Whether no face of the volume cuts the limb.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Vertices that [`triangles`](Self::triangles) refer to: those of the skin, or of a body shape of it, then the corners.
    pub fn vertices(&self, skin: &Mesh) -> Vec<Point3<f32>> {
        skin.vertices.iter().chain(&self.corners).copied().collect()
    }

    /// The skin, or a body shape of it, closed: the triangles of the walls follow those of the skin. Vertices keep their
    /// normals; the corners get those of the walls.
    pub fn close(&self, skin: &Mesh) -> Mesh {
        let mut closed = Mesh {
            vertices: self.vertices(skin),
            normals: Vec::new(),
            triangles: [&skin.triangles[..], &self.triangles].concat(),
        };
        let geometric = closed.geometric_normals();
        closed.normals.clone_from(&skin.normals);
        closed.normals.extend(&geometric[skin.vertices.len()..]);
        closed
    }

    /// Area and centre of each wall of the skin, or of a body shape of it.
    pub fn measured(&self, skin: &Mesh) -> Vec<WallMeasure> {
        let vertex = |id: u32| {
            let behind = id as usize - skin.vertices.len().min(id as usize);
            skin.vertices
                .get(id as usize)
                .unwrap_or_else(|| &self.corners[behind])
                .cast::<f64>()
        };
        let measure = |(face, triangles): &(&'static str, Range<usize>)| {
            let (mut area_mm2, mut moment, mut outward) = (0.0, Vector3::zeros(), Vector3::zeros());
            for triangle in &self.triangles[triangles.clone()] {
                let [a, b, c] = triangle.map(vertex);
                let across = (b - a).cross(&(c - a));
                let area = 0.5 * across.norm();
                outward += across;
                area_mm2 += area;
                moment += (a.coords + b.coords + c.coords) * (area / 3.0);
            }
            WallMeasure {
                face,
                area_mm2,
                centre: Point3::from(moment / area_mm2.max(f64::MIN_POSITIVE)),
                outward: outward.try_normalize(0.0).unwrap_or_default(),
            }
        };
        self.faces.iter().map(measure).collect()
    }
}

/// Border of a skin in the faces of the volume.
struct Rim {
    /// Edges of the walls along the skin, by face; the limb is to their left, seen from outside.
    edges: [Vec<[u32; 2]>; 6],
    of_skin: HashSet<[u32; 2]>,
    /// Voxel coordinates of the vertices of these edges and of the corners, by id in rising order.
    places: Vec<(u32, [f64; 3])>,
    /// Voxel coordinates of the last voxel.
    last: [f64; 3],
    /// Corners of the volume, mm: bit a of the index is set at the end of axis a. Numbered after the skin's vertices.
    corners: [Point3<f32>; 8],
    mirrored: bool,
}

/// A vertex in the plane of a face.
struct InFace {
    at: Point2<f64>,
    id: u32,
}

impl HasPosition for InFace {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

type FaceTriangles = ConstrainedDelaunayTriangulation<InFace>;

impl Rim {
    fn of(grid: &Grid, skin: &Mesh) -> Self {
        let voxel_from_ct = grid.voxel_from_ct();
        let last = grid.size().map(|n| (n - 1) as f64);
        let place = |v: &Point3<f32>| -> [f64; 3] { (voxel_from_ct * v.cast::<f64>()).into() };
        let bits = |v: &Point3<f32>| {
            let place = place(v);
            (0..6)
                .filter(|&face| off(face, &place, &last) < IN_PLANE)
                .fold(0_u8, |bits, face| bits | 1 << face)
        };
        let at_border: Vec<u8> = skin.vertices.iter().map(bits).collect();
        // Edges of a plane that belong to one triangle; walls use them in the opposite direction.
        let mut candidates = Vec::new();
        for [a, b, c] in &skin.triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                if at_border[*from as usize] & at_border[*to as usize] != 0 {
                    candidates.push([*to, *from]);
                }
            }
        }
        let all: HashSet<[u32; 2]> = candidates.iter().copied().collect();
        candidates.retain(|[from, to]| !all.contains(&[*to, *from]));
        let mut edges: [Vec<[u32; 2]>; 6] = Default::default();
        for edge in &candidates {
            let places = edge.map(|id| place(&skin.vertices[id as usize]));
            let farthest = |face: &usize| {
                places
                    .iter()
                    .map(|place| off(*face, place, &last))
                    .fold(0.0, f64::max)
            };
            let common = edge
                .iter()
                .fold(u8::MAX, |bits, id| bits & at_border[*id as usize]);
            let nearest = (0..6)
                .filter(|face| common >> face & 1 == 1)
                .min_by(|a, b| farthest(a).total_cmp(&farthest(b)));
            if let Some(face) = nearest {
                edges[face].push(*edge);
            }
        }
        let mut ids: Vec<u32> = candidates.iter().flatten().copied().collect();
        ids.sort_unstable();
        ids.dedup();
        let mut places: Vec<(u32, [f64; 3])> = ids
            .iter()
            .map(|&id| (id, place(&skin.vertices[id as usize])))
            .collect();
        let corner =
            |at: usize| [0, 1, 2].map(|axis| if at >> axis & 1 == 1 { last[axis] } else { 0.0 });
        let first = skin.vertices.len() as u32;
        places.extend((0..8).map(|at| (first + at as u32, corner(at))));
        Self {
            edges,
            of_skin: candidates.into_iter().collect(),
            places,
            last,
            corners: std::array::from_fn(|at| grid.centre(corner(at)).cast()),
            mirrored: grid.direction().determinant() < 0.0,
        }
    }

    /// The wall in the plane of a face that the rim crosses.
    fn wall(&self, face: usize) -> Vec<[u32; 3]> {
        let (mut triangles, handles) = self.delaunay(face);
        let handle = |id: u32| {
            let at = handles.binary_search_by_key(&id, |(id, _)| *id);
            at.ok().map(|at| handles[at].1)
        };
        // Faces to the left of the rim are limb, those to the right are not; faces connected with them follow.
        let (mut inside, mut right) = (Vec::new(), Vec::new());
        for [from, to] in &self.edges[face] {
            let (Some(from), Some(to)) = (handle(*from), handle(*to)) else {
                continue;
            };
            for edge in triangles.try_add_constraint(from, to) {
                right.push(edge.rev());
                inside.push(edge);
            }
        }
        // Adding an edge flips others, so faces are looked up after all edges have been added.
        let beside = |edges: Vec<spade::handles::FixedDirectedEdgeHandle>| {
            let faces = edges
                .into_iter()
                .filter_map(|edge| triangles.directed_edge(edge).face().as_inner());
            faces.map(|face| face.fix()).collect::<Vec<_>>()
        };
        let (mut next, outside) = (beside(inside), beside(right));
        let mut seen = vec![false; triangles.num_all_faces()];
        for face in outside {
            seen[face.index()] = true;
        }
        let mut limb = vec![false; seen.len()];
        while let Some(face) = next.pop() {
            if std::mem::replace(&mut seen[face.index()], true) {
                continue;
            }
            limb[face.index()] = true;
            for edge in triangles.face(face).adjacent_edges() {
                if !edge.is_constraint_edge() {
                    next.extend(edge.rev().face().as_inner().map(|face| face.fix()));
                }
            }
        }
        corners_of(&triangles, |face| limb[face.index()])
    }

    /// Triangles of the entire rectangle of a face.
    fn whole_face(&self, face: usize) -> Vec<[u32; 3]> {
        corners_of(&self.delaunay(face).0, |_| true)
    }

    /// The vertices in the plane of a face, triangulated, and their handles by id in rising order.
    fn delaunay(&self, face: usize) -> (FaceTriangles, Vec<(u32, FixedVertexHandle)>) {
        let axis = face / 2;
        let [mut u, mut v] = [(axis + 1) % 3, (axis + 2) % 3];
        // (u, v, outwards) is right-handed for the far face of a right-handed grid.
        if (face % 2 == 1) == self.mirrored {
            (u, v) = (v, u);
        }
        // On the border of the rectangle exactly, so that the walls on both sides of an edge of the volume agree.
        let within = |place: f64, axis: usize| match place {
            low if low < IN_PLANE => 0.0,
            high if high > self.last[axis] - IN_PLANE => self.last[axis],
            between => between,
        };
        let mut triangles = FaceTriangles::new();
        let mut handles = Vec::new();
        for (id, place) in self.places.iter().filter(|(id, _)| self.is_in(*id, face)) {
            let at = Point2::new(within(place[u], u), within(place[v], v));
            // Coordinates are those of voxels: finite, and never too small or large.
            if let Ok(handle) = triangles.insert(InFace { at, id: *id }) {
                handles.push((*id, handle));
            }
        }
        (triangles, handles)
    }

    fn is_in(&self, id: u32, face: usize) -> bool {
        let at = self.places.binary_search_by_key(&id, |(id, _)| *id);
        at.is_ok_and(|at| off(face, &self.places[at].1, &self.last) < IN_PLANE)
    }

    /// Whether an edge of a wall runs along the skin.
    fn is_of_skin(&self, edge: [u32; 2]) -> bool {
        self.of_skin.contains(&edge)
    }
}

/// Distance of a place from the plane of a face, voxels.
fn off(face: usize, place: &[f64; 3], last: &[f64; 3]) -> f64 {
    let axis = face / 2;
    let plane = if face % 2 == 1 { last[axis] } else { 0.0 };
    (place[axis] - plane).abs()
}

/// Vertices of the triangles to keep, counter-clockwise.
fn corners_of(
    triangles: &FaceTriangles,
    keep: impl Fn(FixedFaceHandle<InnerTag>) -> bool,
) -> Vec<[u32; 3]> {
    let kept = triangles.inner_faces().filter(|face| keep(face.fix()));
    kept.map(|face| face.vertices().map(|vertex| vertex.data().id))
        .collect()
}
