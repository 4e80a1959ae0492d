//! Where the field of view cuts the limb.

use super::findings::{Finding, FindingCode, Severity};
use super::survey::Survey;
use super::{CutFaces, Measures};

/// Lower limit of tissue. Halfway between air and fat is −550; the margin excludes foam and sheets.
const TISSUE_HU: f32 = -300.0;
/// Smallest thickness of a limb from front to back; anything thinner is couch or sheet.
const THICK_MM: f64 = 10.0;
/// Smallest area reported as a cut; smaller ones are sheets, noise and partial volume, cm².
const LEAST_CUT_CM2: f64 = 4.0;

/// Marks the blocks that are tissue of a thick object.
pub(super) fn thick(survey: &Survey) -> Vec<bool> {
    let [nx, ny, nz] = survey.size;
    let mut thick = vec![false; survey.hu.len()];
    for z in 0..nz {
        for x in 0..nx {
            let tissue = |y: usize| survey.hu[survey.index([x, y, z])] > TISSUE_HU;
            let mut start = 0;
            for y in 0..=ny {
                if y < ny && tissue(y) {
                    continue;
                }
                if (y - start) as f64 * survey.spacing_mm[1] >= THICK_MM {
                    (start..y).for_each(|y| thick[survey.index([x, y, z])] = true);
                }
                start = y + 1;
            }
        }
    }
    thick
}

/// Area of tissue on each face.
pub(super) fn cut_faces(survey: &Survey, thick: &[bool]) -> CutFaces {
    let on = |axis: usize, layer: usize| {
        let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
        let mut count = 0;
        for v in 0..survey.size[b] {
            for u in 0..survey.size[a] {
                let mut place = [layer; 3];
                (place[a], place[b]) = (u, v);
                count += usize::from(thick[survey.index(place)]);
            }
        }
        count as f64 * survey.face_cm2(axis)
    };
    let [right, anterior, inferior] = [0, 1, 2].map(|axis| on(axis, 0));
    let [left, posterior, superior] = [0, 1, 2].map(|axis| on(axis, survey.size[axis] - 1));
    CutFaces {
        right,
        left,
        anterior,
        posterior,
        inferior,
        superior,
    }
}

/// Largest change of padding by lossy compression and rounding.
const PADDING_HU: f32 = 5.0;

/// Area of tissue at the edge of a round field of view; 0 when the field is not round.
///
/// A scanner reconstructs a circle: if every voxel outside the circle inscribed in the slices
/// has the same value, that value is padding, and tissue that touches the circle is cut.
pub(super) fn cut_by_circle(survey: &Survey, thick: &[bool]) -> f64 {
    let [nx, ny, nz] = survey.size;
    let [dx, dy, dz] = survey.spacing_mm;
    let radius = nx as f64 * dx / 2.0;
    if (nx as f64 * dx - ny as f64 * dy).abs() > 0.01 * 2.0 * radius || nx < 20 {
        return 0.0;
    }
    let block = dx.max(dy);
    let from_centre = |x: usize, y: usize| {
        let along = |n: usize, count: usize, d: f64| (n as f64 + 0.5 - count as f64 / 2.0) * d;
        along(x, nx, dx).hypot(along(y, ny, dy))
    };
    let padding = survey.hu[0];
    let mut ring = 0;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let inside = radius - from_centre(x, y);
                let index = survey.index([x, y, z]);
                let measured = (survey.hu[index] - padding).abs() > PADDING_HU;
                if inside < -1.5 * block && measured {
                    return 0.0;
                }
                // Two rings of blocks within the circle, clear of the padding.
                let at_edge = (block..3.0 * block).contains(&inside);
                ring += usize::from(at_edge && thick[index]);
            }
        }
    }
    // The blocks cover the area of the ring; divided by its width, this gives the length.
    ring as f64 * dx * dy / (2.0 * block) * dz / 100.0
}

pub(super) fn check(measures: &Measures) -> Vec<Finding> {
    let cut = measures.cut_cm2;
    let list = |faces: &[(&str, f64)]| {
        let large = faces.iter().filter(|(_, cm2)| *cm2 >= LEAST_CUT_CM2);
        let texts = large.map(|(face, cm2)| format!("{face} ({cm2:.0} cm²)"));
        let texts = texts.collect::<Vec<_>>();
        (!texts.is_empty()).then(|| texts.join(", "))
    };
    let sides = list(&[
        ("right", cut.right),
        ("left", cut.left),
        ("anterior", cut.anterior),
        ("posterior", cut.posterior),
        ("edge of the round field", measures.cut_by_circle_cm2),
    ]);
    let ends = list(&[("inferior", cut.inferior), ("superior", cut.superior)]);
    let sides = sides.map(|faces| {
        let text = format!("the field of view cuts tissue at the side: {faces}");
        Finding::new(FindingCode::CutAtSide, Severity::Caution, text)
    });
    let ends = ends.map(|faces| {
        let text = format!("tissue extends beyond the ends of the scan: {faces}");
        Finding::new(FindingCode::CutAtEnd, Severity::Note, text)
    });
    sides.into_iter().chain(ends).collect()
}
