//! Presence of a couch, and whether its place agrees with the patient position.

use std::iter;
use std::ops::Range;

use super::findings::{Finding, FindingCode, Severity};
use super::survey::Survey;

/// Lower limit of shells, above air and foam: shells of a couch are thin, so that their blocks are half air.
const SHELL_HU: f32 = -750.0;
/// Smallest share of the slices through which a shell runs.
const PERSISTS: f64 = 0.9;
/// Largest thickness of a shell, from front to back.
const THICK_MM: f64 = 20.0;
/// Largest number of columns without shell that do not end it: streaks, joints.
const HOLE: usize = 3;
/// Smallest width of a couch. Skin folds and sheets of real limbs reach 40 mm.
const LEAST_WIDTH_MM: f64 = 60.0;

/// A thin plate, flat or curved, that runs along the whole scan.
pub(super) struct Couch {
    pub width_mm: f64,
    /// Whether it is behind the limb; otherwise it is in front.
    pub behind: bool,
    /// Columns and positions along y where it was found, in blocks, in order of columns.
    path: Vec<(usize, f64)>,
}

/// A thin section that continues one of an earlier column.
struct Link {
    x: usize,
    y: f64,
    before: Option<usize>,
    /// First column of the chain that ends here, and its number of links.
    start: usize,
    count: usize,
}

/// Finds the widest thin plate, if it is wide enough for a couch; `thick` marks blocks of thick objects.
pub(super) fn find(survey: &Survey, thick: &[bool]) -> Option<Couch> {
    let [dx, dy, _] = survey.spacing_mm;
    // A curved couch rises by less than three quarters of its sideways distance.
    let rise = 0.75 * dx / dy + 1.0;
    // Ordered by column, then by y.
    let mut links = Vec::<Link>::new();
    let mut columns = Vec::<Range<usize>>::new();
    let mut widest = None;
    for x in 0..survey.size[0] {
        let first = links.len();
        for y in thin_places(survey, x) {
            let near = columns[x.saturating_sub(HOLE)..].iter().flat_map(|column| {
                let low = links[column.clone()].partition_point(|l| l.y < y - rise);
                let open = (column.start + low..column.end).zip(&links[column.start + low..]);
                open.take_while(|(_, link)| link.y <= y + rise)
            });
            let before = near.max_by_key(|(_, link)| link.count);
            let link = Link {
                x,
                y,
                before: before.map(|(index, _)| index),
                start: before.map_or(x, |(_, link)| link.start),
                count: before.map_or(1, |(_, link)| link.count + 1),
            };
            let width = x - link.start + 1;
            if widest.is_none_or(|(_, most)| width > most) {
                widest = Some((links.len(), width));
            }
            links.push(link);
        }
        columns.push(first..links.len());
    }
    let (last, width) = widest?;
    let width_mm = width as f64 * dx;
    if width_mm < LEAST_WIDTH_MM {
        return None;
    }
    let chain = iter::successors(Some(&links[last]), |link| Some(&links[link.before?]));
    let mut path = chain.map(|link| (link.x, link.y)).collect::<Vec<_>>();
    path.reverse();
    let mean_y = path.iter().map(|(_, y)| y).sum::<f64>() / path.len() as f64;
    Some(Couch {
        width_mm,
        behind: middle_y(survey, thick).is_none_or(|middle| mean_y > middle),
        path,
    })
}

/// Mean position along y of the blocks of thick objects.
fn middle_y(survey: &Survey, thick: &[bool]) -> Option<f64> {
    let [nx, ny, _] = survey.size;
    let places = thick.iter().enumerate().filter(|(_, thick)| **thick);
    let (sum, count) = places.fold((0, 0), |(sum, count), (index, _)| {
        (sum + index / nx % ny, count + 1)
    });
    (count > 0).then(|| sum as f64 / f64::from(count))
}

/// Centres of the thin runs along y in column `x` that persist through the slices.
fn thin_places(survey: &Survey, x: usize) -> Vec<f64> {
    let [_, ny, nz] = survey.size;
    let dense = (0..ny).map(|y| {
        let slices = (0..nz).filter(|&z| survey.hu[survey.index([x, y, z])] > SHELL_HU);
        slices.count() as f64 >= PERSISTS * nz as f64
    });
    let dense = dense.collect::<Vec<_>>();
    let mut places = Vec::new();
    let mut start = 0;
    for (y, _) in dense.iter().enumerate().filter(|(_, dense)| !**dense) {
        let thickness_mm = (y - start) as f64 * survey.spacing_mm[1];
        // A run that begins at the face may be the remainder of something thick.
        if 0 < start && start < y && thickness_mm <= THICK_MM {
            places.push((start + y - 1) as f64 / 2.0);
        }
        start = y + 1;
    }
    places
}

impl Couch {
    /// Removes the couch and everything beyond it from the blocks of thick objects.
    pub fn clear(&self, survey: &Survey, thick: &mut [bool]) {
        let [nx, ny, _] = survey.size;
        for (index, thick) in thick.iter_mut().enumerate() {
            let (x, y) = (index % nx, (index / nx % ny) as f64);
            // The nearest column in which the couch was found.
            let after = self.path.partition_point(|(column, _)| *column < x);
            let shell = self.path[after.min(self.path.len() - 1)].1;
            *thick &= if self.behind { y < shell } else { y > shell };
        }
    }

    /// Returns the finding for the couch, given the position of the patient.
    pub fn finding(&self, position: Option<&str>) -> Finding {
        let (place, lying) = if self.behind {
            ("behind", "supine")
        } else {
            ("in front of", "prone")
        };
        let plate = format!(
            "a couch-like plate {:.0} mm wide lies {place} the limb",
            self.width_mm
        );
        let stated = match position.and_then(|p| p.get(2..)) {
            Some("S") => Some("supine"),
            Some("P") => Some("prone"),
            _ => None,
        };
        match stated {
            Some(stated) if stated != lying => Finding::new(
                FindingCode::CouchMisplaced,
                Severity::Severe,
                format!(
                    "{plate}, but the header says that the patient lay {stated}: the volume may be flipped"
                ),
            ),
            None if !self.behind => Finding::new(
                FindingCode::CouchMisplaced,
                Severity::Caution,
                format!("{plate}: the patient lay prone, or the volume is flipped"),
            ),
            _ => Finding::new(FindingCode::Couch, Severity::Note, plate),
        }
    }
}
