//! Extent of the largest bone in each slice, and where it is as broad as a knee.

use nalgebra::{Point3, Vector2, Vector3};
use ppa_ct::Volume;

use crate::landmarks::hull::Hull;
use crate::landmarks::limb_sections::Sections;
use crate::room::plane::across;

/// Coordinates across and along a limb.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lengthwise {
    across: [Vector3<f64>; 2],
    direction: Vector3<f64>,
}

impl Lengthwise {
    /// Levels run along the unit `direction`.
    pub(crate) fn along(direction: &Vector3<f64>) -> Self {
        let (e1, e2) = across(direction);
        Self {
            across: [e1, e2],
            direction: *direction,
        }
    }

    /// The part of a vector across the limb.
    pub(crate) fn flat(&self, vector: &Vector3<f64>) -> Vector2<f64> {
        Vector2::from(self.across.map(|e| e.dot(vector)))
    }

    /// A vector across the limb, `ct` frame.
    pub(crate) fn vector(&self, flat: &Vector2<f64>) -> Vector3<f64> {
        self.across[0] * flat.x + self.across[1] * flat.y
    }

    /// The point at a place across the limb and a level, `ct` frame.
    pub(crate) fn point(&self, flat: &Vector2<f64>, level_mm: f64) -> Point3<f64> {
        Point3::from(self.vector(flat) + self.direction * level_mm)
    }
}

/// The largest bone of a slice.
///
/// Its convex hull counts, not its outline: the thin shell of spongy bone is often open at 200 HU.
#[derive(Debug, Clone)]
pub(crate) struct Span {
    pub(crate) level_mm: f64,
    pub(crate) hull: Hull,
    /// Whether a second bone as thick as a fibula is next to it.
    pub(crate) has_fibula: bool,
    /// Whether it reaches a face of the scan, so that part of it may be missing.
    pub(crate) is_cut: bool,
}

impl Span {
    /// `None` for a slice without bone; `volume` is the scan that the slices were cut from.
    fn of_slice(
        volume: &Volume,
        sections: &Sections,
        slice: usize,
        frame: &Lengthwise,
    ) -> Option<Self> {
        /// Vessels with contrast agent are thinner than a fibula.
        const FIBULA_MM2: f64 = 65.0;
        const MOST_OF_TIBIA: f64 = 0.7;
        let pieces = sections.bone_pieces(slice);
        let hulls = pieces.into_iter().filter_map(|piece| {
            Hull::around(piece.iter().map(|p| frame.flat(&p.coords)).collect())
        });
        let mut hulls: Vec<Hull> = hulls.collect();
        hulls.sort_by(|a, b| b.area_mm2.total_cmp(&a.area_mm2));
        let second_mm2 = hulls.get(1).map_or(0.0, |second| second.area_mm2);
        let hull = hulls.into_iter().next()?;
        let level_mm = sections.level(slice);
        Some(Self {
            level_mm,
            has_fibula: (FIBULA_MM2..MOST_OF_TIBIA * hull.area_mm2).contains(&second_mm2),
            is_cut: [Vector2::x(), Vector2::y()]
                .iter()
                .any(|along| hull_is_cut(volume, frame, &hull, level_mm, along)),
            hull,
        })
    }
}

/// Whether the scan ends where a bone does along a direction of its slice.
pub(crate) fn hull_is_cut(
    volume: &Volume,
    frame: &Lengthwise,
    hull: &Hull,
    level_mm: f64,
    along: &Vector2<f64>,
) -> bool {
    const MARGIN_MM: f64 = 3.0;
    let [low, high] = hull.extent(along);
    [low - MARGIN_MM, high + MARGIN_MM].into_iter().any(|end| {
        let place = hull.centre + along * (end - hull.centre.dot(along));
        volume.sample(&frame.point(&place, level_mm)).is_none()
    })
}

/// The largest bone of every slice that shows one, from proximal to distal; `volume` is the scan that the slices were cut
/// from.
pub(crate) fn spans(volume: &Volume, sections: &Sections, frame: &Lengthwise) -> Vec<Span> {
    let span = |slice| Span::of_slice(volume, sections, slice, frame);
    let mut spans: Vec<Span> = (0..sections.count()).filter_map(span).collect();
    spans.sort_by(|a, b| b.level_mm.total_cmp(&a.level_mm));
    spans
}

/// A stretch of the limb in which a bone is as broad as a knee.
#[derive(Debug, Clone)]
pub(crate) struct BroadZone {
    /// Lowest and highest level, mm.
    pub(crate) range_mm: [f64; 2],
    /// Largest hull in it.
    pub(crate) most_mm2: f64,
}

/// Condyles and tibial plateaus of adults: plateaus are at least about 62 x 40 mm, at most about 90 x 60 mm; the
/// distal tibia has 1,500 mm².
const BROAD_MM2: f64 = 1800.0;
const BROAD_MM: std::ops::Range<f64> = 52.0..105.0;

/// Stretches with broad bone, from proximal to distal.
///
/// The gap of a knee, where condyles and plateau show as islands, does not end a stretch; a row of vertebrae, a
/// pelvis and a hand are too long or too short for one.
pub(crate) fn broad_zones(spans: &[Span]) -> Vec<BroadZone> {
    const GAP_MM: f64 = 25.0;
    const LENGTH_MM: std::ops::Range<f64> = 20.0..140.0;
    let mut zones: Vec<BroadZone> = Vec::new();
    for span in spans {
        let area_mm2 = span.hull.area_mm2;
        if area_mm2 < BROAD_MM2 || !BROAD_MM.contains(&span.hull.length_mm()) {
            continue;
        }
        match zones.last_mut() {
            Some(zone) if zone.range_mm[0] - span.level_mm <= GAP_MM => {
                zone.range_mm[0] = span.level_mm;
                zone.most_mm2 = zone.most_mm2.max(area_mm2);
            }
            _ => zones.push(BroadZone {
                range_mm: [span.level_mm; 2],
                most_mm2: area_mm2,
            }),
        }
    }
    zones.retain(|zone| LENGTH_MM.contains(&(zone.range_mm[1] - zone.range_mm[0])));
    zones
}

/// Directions of the shafts above and below a broad stretch, where enough of them is seen; unit vectors towards proximal.
pub(crate) struct Shafts {
    pub(crate) femur: Option<Vector3<f64>>,
    pub(crate) tibia: Option<Vector3<f64>>,
}

impl BroadZone {
    /// Slices that show the whole bone within a distance from the end of the stretch: `side` is 1 for above, −1 for below.
    fn beyond<'a>(&self, spans: &'a [Span], side: f64, far_mm: [f64; 2]) -> Vec<&'a Span> {
        let end = if side > 0.0 {
            self.range_mm[1]
        } else {
            self.range_mm[0]
        };
        let there =
            |span: &&Span| (far_mm[0]..=far_mm[1]).contains(&((span.level_mm - end) * side));
        spans.iter().filter(there).collect()
    }

    /// The shafts of a thigh and a lower leg, at least one of which must be visible; `None` if the bones beyond are
    /// neither: a femur is single, a tibia has the fibula next to it.
    pub(crate) fn shafts(&self, spans: &[Span], frame: &Lengthwise) -> Option<Shafts> {
        /// The fibula of a lower leg above an ankle is connected with the tibia for about 40 mm in coarse voxels.
        const FEMUR_MM: [f64; 2] = [20.0, 100.0];
        const TIBIA_MM: [f64; 2] = [15.0, 75.0];
        /// Enough to recognise a shaft, and to measure how it leans.
        const SEEN_MM: f64 = 12.0;
        const ENOUGH_MM: f64 = 25.0;
        let share = |spans: &[&Span]| {
            let with = spans.iter().filter(|span| span.has_fibula).count();
            with as f64 / spans.len().max(1) as f64
        };
        let length = |spans: &[&Span]| match spans {
            [first, .., last] => first.level_mm - last.level_mm,
            _ => 0.0,
        };
        let femur = self.beyond(spans, 1.0, FEMUR_MM);
        let tibia = self.beyond(spans, -1.0, TIBIA_MM);
        let [above_mm, below_mm] = [&femur, &tibia].map(|spans| length(spans));
        let is_leg_below = below_mm >= ENOUGH_MM && share(&tibia) < 0.5;
        let is_leg_above = femur.len() > 2 && share(&femur) > 0.4;
        if is_leg_below || is_leg_above {
            return None;
        }
        let thin = |spans: &[&Span]| {
            let most_mm2 = 0.6 * self.most_mm2;
            let thin = spans.iter().filter(|span| span.hull.area_mm2 < most_mm2);
            10 * thin.count() >= 8 * spans.len()
        };
        let [above, below] = [thin(&femur), thin(&tibia)];
        let is_shaft = above && above_mm >= SEEN_MM || below && below_mm >= SEEN_MM;
        let shaft =
            |spans: &[&Span], is_measured: bool| is_measured.then(|| slope(spans, frame))?;
        is_shaft.then(|| Shafts {
            femur: shaft(&femur, above && above_mm >= ENOUGH_MM),
            tibia: shaft(&tibia, below && below_mm >= ENOUGH_MM),
        })
    }
}

/// Unit direction of the line through the centres of the slices, towards proximal, by least squares; `None` for
/// fewer than three.
fn slope(spans: &[&Span], frame: &Lengthwise) -> Option<Vector3<f64>> {
    if spans.len() < 3 {
        return None;
    }
    let n = spans.len() as f64;
    let level = spans.iter().map(|s| s.level_mm).sum::<f64>() / n;
    let centre = spans.iter().map(|s| s.hull.centre).sum::<Vector2<f64>>() / n;
    let (mut moment, mut spread) = (Vector2::zeros(), 0.0);
    for span in spans {
        moment += (span.hull.centre - centre) * (span.level_mm - level);
        spread += (span.level_mm - level).powi(2);
    }
    Some((frame.vector(&(moment / spread)) + frame.direction).normalize())
}
