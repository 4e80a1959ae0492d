//! Other body shapes from one skin surface: thicker, thinner, locally swollen.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use nalgebra::{Point3, Vector3};
use ppa_core::random::{split_mix, split_mix_at};

use crate::mesh::Mesh;
use crate::neighbours::Neighbours;
use crate::shift_limit::without_folds;
use crate::smooth_normals::smooth_normals;

/// Heights of [`seeded_bumps`], mm: mild to marked swelling.
const HEIGHT_MM: [f64; 2] = [4.0, 10.0];
/// Widths of [`seeded_bumps`], mm.
const SIGMA_MM: [f64; 2] = [8.0, 20.0];
/// Largest shift, and largest height, depth and sigma of a bump, mm.
const MOST_MM: f64 = 200.0;
/// Largest number of bumps per draw.
const MOST_BUMPS: usize = 1000;
/// A bump ends at this many sigma; there it is exp(−8) of its height.
const REACH_SIGMA: f64 = 4.0;
/// Paths along triangle edges are longer than the surface allows, by at most about this factor on a
/// lattice of diagonals.
const EDGE_PATH_EXCESS: f64 = 1.15;

/// A swelling: a Gaussian along the normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bump {
    /// Middle, in the frame of the mesh; the nearest vertex is taken.
    pub centre: Point3<f64>,
    /// Displacement in the middle, mm; negative for a dent.
    pub height_mm: f64,
    /// Standard deviation along the surface, mm.
    pub sigma_mm: f64,
}

/// A region in which bumps may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BumpSite {
    /// Middle, in the frame of the mesh.
    pub centre: Point3<f64>,
    /// Vertices within this distance qualify, mm.
    pub radius_mm: f64,
}

/// Reason why a body shape cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// Bumps were requested without a site.
    #[error("the number of bumps is {count}, but no site is given for them")]
    NoSite {
        /// Requested number of bumps.
        count: usize,
    },
    /// More bumps than the maximum.
    #[error("the number of bumps is {count}, expected at most {MOST_BUMPS}")]
    TooMany {
        /// Requested number of bumps.
        count: usize,
    },
    /// A bump with a value that is not finite or out of range.
    #[error(
        "bump {index} is {height_mm} mm high with a sigma of {sigma_mm} mm: its position must be finite, its height \
         between -{MOST_MM} and {MOST_MM} mm, its sigma above 0 and at most {MOST_MM} mm"
    )]
    Size {
        /// Place in the list, from 0.
        index: usize,
        /// Height found, mm.
        height_mm: f64,
        /// Width found, mm.
        sigma_mm: f64,
    },
    /// A shift that is not a number or out of range.
    #[error("the shift is {found_mm} mm, expected -{MOST_MM} to {MOST_MM} mm")]
    Shift {
        /// Distance found, mm.
        found_mm: f64,
    },
    /// No site contains a vertex.
    #[error("no vertex of the mesh lies in any of the {sites} bump sites")]
    NoSkin {
        /// Number of sites.
        sites: usize,
    },
}

/// The mesh moved along its smoothed normals, outward for a positive distance.
///
/// Normals are averaged over a few rings of neighbours first, so that creases and noise do not
/// cause spikes. The distance is exact nearly everywhere. Where the skin would turn inside out or
/// pass through itself (inwards at the tips of toes, outwards between them), it moves less, and the
/// distance recovers by 0.2 mm per millimetre of skin around. [`Displacement`](crate::Displacement) shows where.
///
/// # Errors
/// [`ShapeError::Shift`] for a distance that is not a number or out of range.
pub fn offset(mesh: &Mesh, distance_mm: f64) -> Result<Mesh, ShapeError> {
    if !(-MOST_MM..=MOST_MM).contains(&distance_mm) {
        return Err(ShapeError::Shift {
            found_mm: distance_mm,
        });
    }
    let neighbours = Neighbours::of(mesh);
    let normals = smooth_normals(mesh, &neighbours);
    let shifts = vec![distance_mm; mesh.vertices.len()];
    Ok(displaced(mesh, &neighbours, normals, shifts))
}

/// The mesh with bumps along its smoothed normals; overlapping bumps add up.
///
/// Distance from the middle is measured along the surface, so that the other side of a thin limb
/// stays where it is. Where the skin would fold or pass through itself it moves less, as in
/// [`offset`]. A mesh without vertices stays as it is.
///
/// # Errors
/// [`ShapeError::Size`] for a bump whose position, height or width is not a number or out of range.
pub fn add_bumps(mesh: &Mesh, bumps: &[Bump]) -> Result<Mesh, ShapeError> {
    for (index, bump) in bumps.iter().enumerate() {
        let placed = bump.centre.coords.iter().all(|c| c.is_finite());
        let (height_mm, sigma_mm) = (bump.height_mm, bump.sigma_mm);
        let high = height_mm.abs() <= MOST_MM;
        if !(placed && high && sigma_mm > 0.0 && sigma_mm <= MOST_MM) {
            return Err(ShapeError::Size {
                index,
                height_mm,
                sigma_mm,
            });
        }
    }
    let neighbours = Neighbours::of(mesh);
    let mut heights = vec![0.0; mesh.vertices.len()];
    for bump in bumps {
        let reach = REACH_SIGMA * bump.sigma_mm;
        for (vertex, distance) in surface_distances(mesh, &neighbours, &bump.centre, reach) {
            heights[vertex as usize] +=
                bump.height_mm * (-0.5 * (distance / bump.sigma_mm).powi(2)).exp();
        }
    }
    let normals = smooth_normals(mesh, &neighbours);
    Ok(displaced(mesh, &neighbours, normals, heights))
}

/// `count` bumps of 4 to 10 mm height and 8 to 20 mm sigma at vertices of the sites, taken in turn.
///
/// A site without vertices is skipped: the scan may end before it. The result depends only on the
/// mesh, the sites and the seed; bump i is the same for any count.
///
/// # Errors
/// [`ShapeError`] when bumps are requested but there is no site or no site contains a vertex.
pub fn seeded_bumps(
    mesh: &Mesh,
    sites: &[BumpSite],
    count: usize,
    seed: u64,
) -> Result<Vec<Bump>, ShapeError> {
    if count == 0 {
        return Ok(Vec::new());
    }
    if count > MOST_BUMPS {
        return Err(ShapeError::TooMany { count });
    }
    if sites.is_empty() {
        return Err(ShapeError::NoSite { count });
    }
    let skin_of = |site: &BumpSite| -> Vec<Point3<f64>> {
        let points = mesh.vertices.iter().map(|v| v.cast::<f64>());
        points
            .filter(|v| (v - site.centre).norm() <= site.radius_mm)
            .collect()
    };
    let skins: Vec<Vec<Point3<f64>>> = sites
        .iter()
        .map(skin_of)
        .filter(|skin| !skin.is_empty())
        .collect();
    if skins.is_empty() {
        return Err(ShapeError::NoSkin { sites: sites.len() });
    }
    let bump = |index: usize| {
        let skin = &skins[index % skins.len()];
        let draw = |what: u64| uniform(seed, 3 * index as u64 + what);
        let within = |range: [f64; 2], u: f64| range[0] + (range[1] - range[0]) * u;
        Bump {
            centre: skin[(draw(0) * skin.len() as f64) as usize],
            height_mm: within(HEIGHT_MM, draw(1)),
            sigma_mm: within(SIGMA_MM, draw(2)),
        }
    };
    Ok((0..count).map(bump).collect())
}

/// Uniform in [0, 1): number `index` of a SplitMix64 generator seeded with `seed`.
fn uniform(seed: u64, index: u64) -> f64 {
    let bits = split_mix_at(split_mix(seed), index);
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

fn displaced(
    mesh: &Mesh,
    neighbours: &Neighbours,
    normals: Vec<Vector3<f64>>,
    shifts_mm: Vec<f64>,
) -> Mesh {
    let places = without_folds(mesh, neighbours, &normals, shifts_mm);
    let vertices = places.iter().map(|place| place.cast()).collect();
    let mut moved = Mesh {
        vertices,
        normals: Vec::new(),
        triangles: mesh.triangles.clone(),
    };
    // Where nothing moved nearby, the original normals are better.
    let turned = moved.geometric_normals();
    let before = mesh.geometric_normals();
    moved.normals = turned
        .into_iter()
        .zip(before)
        .zip(&mesh.normals)
        .map(|((now, then), &exact)| {
            if (now - then).norm() < 1e-6 {
                exact
            } else {
                now
            }
        })
        .collect();
    moved
}

#[derive(PartialEq)]
struct Reached(f64, u32);

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        // Nearest first out of a max-heap; the vertex settles ties.
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

/// Vertices within `reach_mm` of the vertex nearest to `centre`, with their distances along the surface.
///
/// Shortest edge paths (Dijkstra) overestimate; the straight distance is a lower bound and nearly
/// right where the surface is flat. The larger of straight and shortened path is continuous
/// and never lets a bump through to the other side.
fn surface_distances(
    mesh: &Mesh,
    neighbours: &Neighbours,
    centre: &Point3<f64>,
    reach_mm: f64,
) -> Vec<(u32, f64)> {
    let squared = |v: &Point3<f32>| (v.cast::<f64>() - centre).norm_squared();
    let nearest = (0..mesh.vertices.len())
        .min_by(|&a, &b| squared(&mesh.vertices[a]).total_cmp(&squared(&mesh.vertices[b])));
    let Some(seed) = nearest else {
        return Vec::new();
    };
    let position = |v: u32| mesh.vertices[v as usize].cast::<f64>();
    let start = position(seed as u32);
    let mut best = HashMap::from([(seed as u32, 0.0)]);
    let mut heap = BinaryHeap::from([Reached(0.0, seed as u32)]);
    let mut found = Vec::new();
    while let Some(Reached(path, vertex)) = heap.pop() {
        if path > best[&vertex] {
            continue;
        }
        let here = position(vertex);
        found.push((vertex, (here - start).norm().max(path / EDGE_PATH_EXCESS)));
        for &next in neighbours.of_vertex(vertex as usize) {
            let longer = path + (position(next) - here).norm();
            if longer <= reach_mm * EDGE_PATH_EXCESS
                && best.get(&next).is_none_or(|&known| longer < known)
            {
                best.insert(next, longer);
                heap.push(Reached(longer, next));
            }
        }
    }
    found
}
