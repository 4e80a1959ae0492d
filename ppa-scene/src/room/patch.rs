//! Connected patches of a plane's points, and the plane that fits one best.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Point3, SymmetricEigen, Unit, Vector3};

use crate::room::plane::{Plane, across};
use crate::room::plane_settings::PlaneSettings;

/// A cell of the lattice drawn on a plane.
type Cell = (i64, i64);

/// A lattice drawn on a plane; fixed while the plane is refined, so that cells stay comparable.
#[derive(Debug, Clone, Copy)]
struct Lattice {
    origin: Point3<f64>,
    e1: Vector3<f64>,
    e2: Vector3<f64>,
    cell_mm: f64,
}

impl Lattice {
    fn on(plane: &Plane, cell_mm: f64) -> Self {
        let (e1, e2) = across(&plane.normal);
        Self {
            origin: plane.project(&Point3::origin()),
            e1,
            e2,
            cell_mm,
        }
    }

    fn cell(&self, p: &Point3<f64>) -> Cell {
        let v = p - self.origin;
        // Clamped, so that neighbours of the outermost cell can still be numbered.
        let index = |e: &Vector3<f64>| (v.dot(e) / self.cell_mm).floor().clamp(-1e15, 1e15) as i64;
        (index(&self.e1), index(&self.e2))
    }
}

/// Connected cells of a plane, and the points in and above them.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    plane: Plane,
    lattice: Lattice,
    cells: BTreeSet<Cell>,
    members: Vec<Point3<f64>>,
}

/// Points within this many thresholds of the plane may join a patch while it is refined.
const MEMBER_THRESHOLDS: f64 = 4.0;

/// A plane fitted to one patch.
#[derive(Debug, Clone)]
pub(crate) struct Sheet {
    pub(crate) plane: Plane,
    pub(crate) inliers: usize,
    pub(crate) rms_mm: f64,
    pub(crate) centre: Point3<f64>,
    lattice: Lattice,
    cells: BTreeSet<Cell>,
}

impl Patch {
    /// The connected patches of at least the smallest area, largest first.
    ///
    /// A cell counts as filled if it contains at least a tenth of the points of a typical cell,
    /// and no fewer than three, so that stray points neither bridge gaps nor look like a surface.
    pub(crate) fn of_plane(
        points: &[Point3<f64>],
        plane: &Plane,
        settings: &PlaneSettings,
    ) -> Vec<Self> {
        let lattice = Lattice::on(plane, settings.cell_mm);
        let mut counts: BTreeMap<Cell, usize> = BTreeMap::new();
        for p in points {
            if plane.signed_distance(p).abs() <= settings.threshold_mm {
                *counts.entry(lattice.cell(p)).or_default() += 1;
            }
        }
        // Half of all points lie in cells at least this full.
        let mut by_count: Vec<usize> = counts.values().copied().collect();
        by_count.sort_unstable_by(|a, b| b.cmp(a));
        let half: usize = by_count.iter().sum::<usize>() / 2;
        let mut seen = 0;
        let typical = by_count
            .into_iter()
            .find(|count| {
                seen += count;
                seen >= half
            })
            .unwrap_or(0);
        let filled_from = (typical / 10).max(3);
        let mut open: BTreeSet<Cell> = counts
            .into_iter()
            .filter(|(_, count)| *count >= filled_from)
            .map(|(cell, _)| cell)
            .collect();
        let min_cells = (settings.min_area_mm2 / settings.cell_mm.powi(2)).ceil() as usize;
        let mut patches = Vec::new();
        while let Some(start) = open.pop_first() {
            let mut cells = BTreeSet::new();
            let mut front = vec![start];
            while let Some((i, j)) = front.pop() {
                cells.insert((i, j));
                for near in [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)] {
                    if open.remove(&near) {
                        front.push(near);
                    }
                }
            }
            if cells.len() >= min_cells {
                patches.push(Self {
                    plane: *plane,
                    lattice,
                    cells,
                    members: Vec::new(),
                });
            }
        }
        patches.sort_by_key(|patch| std::cmp::Reverse(patch.cells.len()));
        // Points are assigned in one pass, since there may be as many patches as cells.
        let numbered = patches.iter().enumerate();
        let patch_of: BTreeMap<Cell, usize> = numbered
            .flat_map(|(number, patch)| patch.cells.iter().map(move |cell| (*cell, number)))
            .collect();
        for p in points {
            if plane.signed_distance(p).abs() <= MEMBER_THRESHOLDS * settings.threshold_mm
                && let Some(&number) = patch_of.get(&lattice.cell(p))
            {
                patches[number].members.push(*p);
            }
        }
        patches
    }

    /// The total-least-squares plane of the patch's points, fitted until they stay the same.
    ///
    /// `None` if the points do not concentrate on a plane: evenly spread points put twice as many
    /// between one and three thresholds as within one.
    pub(crate) fn refined(self, settings: &PlaneSettings) -> Option<Sheet> {
        let members = &self.members;
        let mut plane = self.plane;
        let mut reach_mm = settings.threshold_mm;
        let mut fit = None;
        let mut last = Vec::new();
        for _ in 0..MAX_REFITS {
            let near: Vec<usize> = (0..members.len())
                .filter(|i| plane.signed_distance(&members[*i]).abs() <= reach_mm)
                .collect();
            if near == last {
                break;
            }
            let (fitted, centre, rms_mm) = total_least_squares(members, &near, &plane)?;
            plane = fitted;
            // Three standard deviations keep a Gaussian sheet complete; points that a wall or a cushion
            // adds evenly over the threshold are cut off.
            reach_mm = settings
                .threshold_mm
                .min(3.0 * robust_sigma(members, &near, &plane).max(0.01));
            fit = Some((near.len(), rms_mm, centre));
            last = near;
        }
        let (_, rms_mm, centre) = fit?;
        let within = |reach: f64| {
            members
                .iter()
                .filter(|p| plane.signed_distance(p).abs() <= reach)
                .count()
        };
        let inliers = within(settings.threshold_mm);
        let beside = within(3.0 * settings.threshold_mm) - inliers;
        (inliers > beside && inliers >= 3).then_some(Sheet {
            plane,
            inliers,
            rms_mm,
            centre,
            lattice: self.lattice,
            cells: self.cells,
        })
    }
}

const MAX_REFITS: usize = 30;

/// Standard deviation from the median absolute distance (1.4826 = 1 / Φ⁻¹(3/4)).
fn robust_sigma(members: &[Point3<f64>], near: &[usize], plane: &Plane) -> f64 {
    let mut distances: Vec<f64> = near
        .iter()
        .map(|i| plane.signed_distance(&members[*i]).abs())
        .collect();
    let middle = distances.len() / 2;
    let (_, median, _) = distances.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * *median
}

/// Plane through the mean along the direction of least scatter, facing as before; also the mean
/// and the root mean square distance. `None` for fewer than three points.
fn total_least_squares(
    members: &[Point3<f64>],
    near: &[usize],
    facing: &Plane,
) -> Option<(Plane, Point3<f64>, f64)> {
    if near.len() < 3 {
        return None;
    }
    let n = near.len() as f64;
    let mean = near
        .iter()
        .fold(Vector3::zeros(), |sum, i| sum + members[*i].coords)
        / n;
    let scatter = near.iter().fold(Matrix3::zeros(), |sum, i| {
        let d = members[*i].coords - mean;
        sum + d * d.transpose()
    }) / n;
    let eigen = SymmetricEigen::new(scatter);
    let least = eigen.eigenvalues.imin();
    let normal = Unit::new_normalize(eigen.eigenvectors.column(least).into_owned());
    let normal = if normal.dot(&facing.normal) < 0.0 {
        -normal
    } else {
        normal
    };
    let centre = Point3::from(mean);
    let rms_mm = eigen.eigenvalues[least].max(0.0).sqrt();
    Some((Plane::through(&centre, normal), centre, rms_mm))
}

impl Sheet {
    /// Whether a point of the plane is on the patch or in a cell next to it: marks and the
    /// patient leave holes in a recorded table.
    pub(crate) fn covers(&self, p: &Point3<f64>) -> bool {
        let (i, j) = self.lattice.cell(p);
        (-1..=1).any(|di| (-1..=1).any(|dj| self.cells.contains(&(i + di, j + dj))))
    }
}
