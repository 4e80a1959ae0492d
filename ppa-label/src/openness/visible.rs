//! Visible parts of each gutter: areas that rays pass freely, and contrast.

use super::bones::AnkleBone;
use super::exposure::Exposure;
use super::joint_space::{FREE_CHORDS_MM, JointSpace, SeenGap};
use super::rays::{PIXEL_MM, Ray, Window, middles};

/// Shortest path of a ray through a gap, mm: shorter ones only graze its rim.
const LEAST_PATH_MM: f64 = 3.0;
/// Search range for the margins above and below the superior gutter, mm.
const MARGIN_MM: f64 = 6.0;
/// Column and row spacing of the samples of the superior gutter, mm.
const COLUMN_MM: f64 = 1.0;
const ROW_MM: f64 = 0.5;
impl JointSpace {
    /// Areas through which rays pass freely, for each of [`FREE_CHORDS_MM`].
    pub(super) fn open_areas_mm2(&self, seen: &SeenGap, exposure: &Exposure) -> [f64; 3] {
        let bones = &self.bones;
        let window = Window::around(&seen.gaps, exposure);
        let beside = [bones.body(AnkleBone::Talus), bones.body(seen.opposite)];
        let along = middles(window.along_mm, PIXEL_MM);
        let pixels = middles(window.across_mm, PIXEL_MM)
            .flat_map(|across| along.clone().map(move |along| [across, along]));
        let chords = pixels
            .map(|pixel| Ray::through(exposure, pixel, bones))
            .filter(|ray| ray.path_mm(&seen.voxels) >= LEAST_PATH_MM)
            .map(|ray| ray.chord_mm(bones, &beside, FREE_CHORDS_MM[2]));
        let mut areas = [0.0; 3];
        for chord in chords {
            for (area, free) in areas.iter_mut().zip(FREE_CHORDS_MM) {
                if chord <= free {
                    *area += PIXEL_MM * PIXEL_MM;
                }
            }
        }
        areas
    }

    /// Contrast of the superior gutter, averaged over the columns that show it.
    pub(super) fn contrast(&self, exposure: &Exposure) -> f64 {
        let window = Window::around(&self.superior.gaps, exposure);
        let [low, high] = window.along_mm;
        let rows = middles([low - MARGIN_MM, high + MARGIN_MM], ROW_MM);
        let of_columns: Vec<f64> = middles(window.across_mm, COLUMN_MM)
            .filter_map(|across| self.contrast_of_column(exposure, across, rows.clone()))
            .collect();
        of_columns.iter().sum::<f64>() / of_columns.len().max(1) as f64
    }

    fn contrast_of_column(
        &self,
        exposure: &Exposure,
        across: f64,
        rows: impl Iterator<Item = f64>,
    ) -> Option<f64> {
        let bones = &self.bones;
        let column: Vec<(bool, f64)> = rows
            .map(|along| {
                let ray = Ray::through(exposure, [across, along], bones);
                let path = ray.path_mm(&self.superior.voxels);
                (
                    path >= LEAST_PATH_MM,
                    ray.chord_mm(bones, &[bones.skeleton()], f64::INFINITY),
                )
            })
            .collect();
        let first = column.iter().position(|(in_gap, _)| *in_gap)?;
        let last = column.iter().rposition(|(in_gap, _)| *in_gap)?;
        let margin = (MARGIN_MM / ROW_MM) as usize;
        let most = |rows: &[(bool, f64)]| rows.iter().map(|row| row.1).fold(0.0, f64::max);
        let above = most(&column[first.saturating_sub(margin)..first]);
        let below = most(&column[last + 1..(last + 1 + margin).min(column.len())]);
        let beside = above.min(below);
        let gap = column[first..=last].iter().map(|row| row.1);
        let least = gap.fold(f64::INFINITY, f64::min);
        Some(if least < beside {
            1.0 - least / beside
        } else {
            0.0
        })
    }
}
