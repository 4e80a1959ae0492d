//! Length, volume and girth of a limb.

use ppa_ct::Volume;

use super::sections::LimbSections;

/// How large a limb is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimbSize {
    /// Length along the scan's limb direction, mm.
    pub length_mm: f64,
    /// Volume, mm³.
    pub volume_mm3: f64,
    /// Median area of its cross-sections, mm².
    pub section_mm2: f64,
}

impl LimbSize {
    pub(super) fn of(volume: &Volume, mask: &[bool], sections: &LimbSections) -> Self {
        let voxels = mask.iter().filter(|inside| **inside).count();
        let voxel_mm3 = volume
            .grid()
            .ct_from_voxel()
            .matrix()
            .fixed_view::<3, 3>(0, 0)
            .determinant()
            .abs();
        let volume_mm3 = voxels as f64 * voxel_mm3;
        let levels = sections.0.iter().map(|section| section.above_mm);
        let (low, high) = levels.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), level| {
            (low.min(level), high.max(level))
        });
        let mut areas: Vec<f64> = sections.0.iter().map(|section| section.area_mm2).collect();
        areas.sort_by(f64::total_cmp);
        let Some(&section_mm2) = areas.get(areas.len() / 2) else {
            return Self {
                length_mm: 0.0,
                volume_mm3,
                section_mm2: 0.0,
            };
        };
        // Levels are those of the slices' middles.
        let slices = areas.len() as f64;
        let length_mm = (high - low) * slices / (slices - 1.0).max(1.0);
        Self {
            length_mm,
            volume_mm3,
            section_mm2,
        }
    }
}
