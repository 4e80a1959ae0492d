//! Position of the knee joint: the gap between femoral condyles and tibial plateau.

use nalgebra::{Point3, Vector2, Vector3};
use ppa_ct::{Volume, VolumeError};

use crate::landmarks::bone_spans::{BroadZone, Lengthwise, Span, broad_zones, hull_is_cut, spans};
use crate::landmarks::condyles::Condyles;
use crate::landmarks::knee_gap::Gap;
use crate::landmarks::limb_sections::Sections;

/// The knee of a leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Knee {
    /// Centre of the tibial plateau, in the middle of the joint space.
    pub(crate) centre: Point3<f64>,
    /// How much less dense the gap is than the bone on either side of it: median over columns.
    pub(crate) depth_hu: f64,
    /// Unit direction through the middle of both compartments' gaps, seen from the front, towards the patient's right.
    pub(crate) joint_line: Vector3<f64>,
    /// Unit direction to the front, across the limb.
    pub(crate) anterior: Vector3<f64>,
    /// Whether [`Self::anterior`] is perpendicular to the posterior condylar line: the scan shows the back of both condyles.
    pub(crate) by_condyles: bool,
    /// Whether the scan cuts the plateau, so that the middle of the notch between the condyles or of the gap replaces
    /// its centre.
    pub(crate) is_cut: bool,
}

/// A knee with the data from which its axis is derived.
pub(crate) struct FoundKnee<'a> {
    pub(crate) knee: Knee,
    /// Slices across the shaft.
    pub(crate) sections: Sections<'a>,
    /// Centres of femur and tibia in the slices that show them whole, from proximal to distal.
    pub(crate) bones: Vec<Point3<f64>>,
}

/// Looks for a knee in a limb: a stretch of bone as broad as condyles and plateau, a single shaft above or one with a
/// fibula below, a gap through most of its columns, and a notch that opens to the back above that gap only.
///
/// `None` if there is no such place. The returned slices are across the tibia's shaft, or across the
/// femur's if less than 25 mm of the tibia's are visible.
///
/// # Errors
/// When the scan cannot be cut across the shaft.
pub(crate) fn find_knee<'a>(
    volume: &'a Volume,
    mask: &'a [bool],
    towards_proximal: &Vector3<f64>,
) -> Result<Option<FoundKnee<'a>>, VolumeError> {
    let first = Sections::along(volume, mask, towards_proximal);
    let frame = Lengthwise::along(&first.direction);
    let first_spans = spans(volume, &first, &frame);
    for zone in broad_zones(&first_spans) {
        let in_the_scan = || View {
            sections: None,
            direction: first.direction,
            frame,
            spans: first_spans.clone(),
            zone: zone.clone(),
        };
        let Some(view) = in_the_scan().across_the_shaft(volume, mask)? else {
            continue;
        };
        // A plateau that slopes far to the back may lie level in the scan, though not across the shaft.
        if let Some(knee) = view.knee(volume).or_else(|| in_the_scan().knee(volume)) {
            return Ok(Some(FoundKnee {
                knee,
                bones: view.bones(),
                sections: view.sections.unwrap_or(first),
            }));
        }
    }
    Ok(None)
}

/// A broad stretch of a limb in slices.
struct View<'a> {
    /// `None` for the scan's own slices.
    sections: Option<Sections<'a>>,
    direction: Vector3<f64>,
    frame: Lengthwise,
    spans: Vec<Span>,
    zone: BroadZone,
}

impl<'a> View<'a> {
    /// The same stretch in slices across the shaft, if it is inclined by more than 3 degrees; `None` if the bones beyond are
    /// not shafts of a leg.
    fn across_the_shaft(
        mut self,
        volume: &Volume,
        mask: &[bool],
    ) -> Result<Option<Self>, VolumeError> {
        const LEAN: f64 = 0.9986; // cos 3°
        const STEEPEST: f64 = 0.82; // cos 35°
        for _ in 0..2 {
            let Some(shafts) = self.zone.shafts(&self.spans, &self.frame) else {
                return Ok(None);
            };
            let shaft = shafts.tibia.or(shafts.femur);
            let aslant = shaft.filter(|s| (STEEPEST..LEAN).contains(&s.dot(&self.direction)));
            let Some(shaft) = aslant else { break };
            let sections = Sections::across(volume, mask, &shaft)?;
            let frame = Lengthwise::along(&shaft);
            let spans = spans(volume, &sections, &frame);
            let level = shaft.dot(&self.middle().coords);
            let here = |zone: &BroadZone| (zone.range_mm[0]..=zone.range_mm[1]).contains(&level);
            let Some(zone) = broad_zones(&spans).into_iter().find(here) else {
                return Ok(None);
            };
            self = View {
                sections: Some(sections),
                direction: shaft,
                frame,
                spans,
                zone,
            };
        }
        Ok(Some(self))
    }
}

impl View<'_> {
    fn within(&self, low_mm: f64, high_mm: f64) -> Vec<&Span> {
        let there = |span: &&Span| (low_mm..=high_mm).contains(&span.level_mm);
        self.spans.iter().filter(there).collect()
    }

    /// Slices between two levels in which the bone is about as large as the broadest.
    fn large(&self, low_mm: f64, high_mm: f64) -> Vec<&Span> {
        let mut spans = self.within(low_mm, high_mm);
        spans.retain(|span| 2.0 * span.hull.area_mm2 >= self.zone.most_mm2);
        spans
    }

    /// Centres of the bones that slices show whole.
    fn bones(&self) -> Vec<Point3<f64>> {
        let whole = self.spans.iter().filter(|span| !span.is_cut);
        whole
            .map(|span| self.frame.point(&span.hull.centre, span.level_mm))
            .collect()
    }

    /// A point in the middle of the stretch.
    fn middle(&self) -> Point3<f64> {
        let [low, high] = self.zone.range_mm;
        let spans = self.within(low, high);
        let n = spans.len().max(1) as f64;
        let centre = spans
            .iter()
            .map(|span| span.hull.centre)
            .sum::<Vector2<f64>>()
            / n;
        self.frame.point(&centre, 0.5 * (low + high))
    }

    fn knee(&self, volume: &Volume) -> Option<Knee> {
        /// The broad stretch of a knee reaches this far below and above the gap.
        const LEAST_MM: [f64; 2] = [8.0, 20.0];
        const MARGIN_MM: f64 = 5.0;
        let [low, high] = self.zone.range_mm;
        let (mut least, mut most) = (
            Vector2::repeat(f64::INFINITY),
            Vector2::repeat(f64::NEG_INFINITY),
        );
        for span in self.within(low, high) {
            let [x, y] = [Vector2::x(), Vector2::y()].map(|axis| span.hull.extent(&axis));
            least = least.inf(&Vector2::new(x[0], y[0]));
            most = most.sup(&Vector2::new(x[1], y[1]));
        }
        let levels = [low - MARGIN_MM, high + MARGIN_MM];
        let gap = Gap::find(volume, &self.frame, [least, most], levels)?;
        let (_, gap_mm) = gap.centre()?;
        if gap_mm - low < LEAST_MM[0] || high - gap_mm < LEAST_MM[1] {
            return None;
        }
        let broad = self.large(gap_mm - 20.0, gap_mm + 40.0);
        let condyles = Condyles {
            volume,
            frame: &self.frame,
            gap_mm,
            broad: &broad,
        };
        let facing = condyles.facing()?;
        let side = facing.aside();
        let [first, second] =
            [-1.0, 1.0].map(|sign| compartment(&gap, &side, facing.notch_mm, sign));
        let (first, second) = (first?, second?);
        let (centre, is_cut) = self.plateau(volume, &gap, &facing.posterior, facing.notch_mm)?;
        let share = (centre.dot(&side) - first.0) / (second.0 - first.0);
        let level_mm = first.1 + (second.1 - first.1) * share;
        let line =
            self.frame.vector(&side) * (second.0 - first.0) + self.direction * (second.1 - first.1);
        let anterior = -self.frame.vector(&facing.posterior);
        let right = anterior.cross(&self.direction);
        Some(Knee {
            centre: self.frame.point(&centre, level_mm),
            depth_hu: gap.depth_hu(),
            joint_line: line.normalize() * line.dot(&right).signum(),
            anterior,
            by_condyles: facing.by_condyles,
            is_cut,
        })
    }

    /// Centre of the tibial plateau across the limb, and whether the scan cuts it.
    fn plateau(
        &self,
        volume: &Volume,
        gap: &Gap,
        posterior: &Vector2<f64>,
        notch_mm: f64,
    ) -> Option<(Vector2<f64>, bool)> {
        /// Above the head of the fibula.
        const BELOW_MM: [f64; 2] = [4.0, 12.0];
        let (gap_place, gap_mm) = gap.centre()?;
        let side = Vector2::new(-posterior.y, posterior.x);
        let slices = self.large(gap_mm - BELOW_MM[1], gap_mm - BELOW_MM[0]);
        if slices.is_empty() {
            return Some((side * notch_mm + posterior * gap_place.dot(posterior), true));
        }
        let n = slices.len() as f64;
        let centre = slices
            .iter()
            .map(|span| span.hull.centre)
            .sum::<Vector2<f64>>()
            / n;
        let cut = |along: &Vector2<f64>| {
            let cut =
                |span: &&Span| hull_is_cut(volume, &self.frame, &span.hull, span.level_mm, along);
            slices.iter().any(cut)
        };
        let (cut_aside, cut_along) = (cut(&side), cut(posterior));
        let aside = if cut_aside {
            notch_mm
        } else {
            centre.dot(&side)
        };
        let back = if cut_along {
            gap_place.dot(posterior)
        } else {
            centre.dot(posterior)
        };
        Some((side * aside + posterior * back, cut_aside || cut_along))
    }
}

/// Place along `side` and level of the gap in the middle of a compartment.
fn compartment(gap: &Gap, side: &Vector2<f64>, notch_mm: f64, sign: f64) -> Option<(f64, f64)> {
    /// Between tibial eminence and rim.
    const FROM_NOTCH_MM: std::ops::Range<f64> = 8.0..42.0;
    const MIDDLE_MM: f64 = 8.0;
    const FEWEST: usize = 5;
    let beside = gap.part(|p| FROM_NOTCH_MM.contains(&(sign * (p.place.dot(side) - notch_mm))));
    let (middle, _) = beside.centre()?;
    let middle = beside.part(|p| (p.place - middle).norm() <= MIDDLE_MM);
    let (place, level_mm) = middle.centre()?;
    (middle.points.len() >= FEWEST).then(|| (place.dot(side), level_mm))
}
