//! What became of a scan's voxels: how much of each material, and where the scan or the calibration ran out.

use ppa_ct::Volume;
use serde::Serialize;

use crate::phantom::hu::HuCalibration;
use crate::phantom::segmentation::Segmentation;
use crate::phantom::voxels::PhantomError;

/// Elements from scandium on count as metal.
const LIGHTEST_METAL: u8 = 21;

/// What a calibration makes of a scan. Voxels outside the mask are counted once and left out of everything else.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Audit {
    /// Voxels of the scan.
    pub voxels: usize,
    /// Voxels outside the mask.
    pub outside_mask: usize,
    /// Volume of one voxel, mm³.
    pub voxel_mm3: f64,
    /// Lowest HU, and the voxels that have exactly it. Many are a sign that the scan is clipped below.
    pub lowest_hu: f32,
    /// See `lowest_hu`.
    pub voxels_at_lowest: usize,
    /// Highest HU, and the voxels that have exactly it. Many, at 3071 above all, are a sign that the scan is clipped
    /// above: metals cannot be told apart there, and their density is that of the calibration.
    pub highest_hu: f32,
    /// See `highest_hu`.
    pub voxels_at_highest: usize,
    /// Mass of all voxels, g.
    pub mass_g: f64,
    /// Volume of the segments that are metal: more than half of their mass in elements from scandium (Z = 21) on, cm³.
    pub metal_cm3: f64,
    /// The segments of the calibration, from low to high HU.
    pub segments: Vec<SegmentAudit>,
}

/// What a scan holds of one segment of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegmentAudit {
    /// Name of the segment.
    pub name: String,
    /// Voxels.
    pub voxels: usize,
    /// Their volume, cm³.
    pub volume_cm3: f64,
    /// Their mass, g.
    pub mass_g: f64,
    /// Lowest HU among them.
    pub lowest_hu: Option<f32>,
    /// Highest HU among them.
    pub highest_hu: Option<f32>,
    /// Voxels below the first knot of a density curve of two or more: they get the density of that knot.
    pub below_curve: usize,
    /// Voxels above the last knot of a density curve of two or more: they get the density of that knot.
    pub above_curve: usize,
    /// Materials that occur, in order of their attenuation for a mixture.
    pub materials: Vec<MaterialCount>,
}

/// How often a material occurs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialCount {
    /// Name of the material.
    pub name: String,
    /// Voxels.
    pub voxels: usize,
}

/// A set of Hounsfield values: how many, and how often the extremes occur.
struct Range {
    lowest: f32,
    at_lowest: usize,
    highest: f32,
    at_highest: usize,
}

impl Range {
    const EMPTY: Self = Self {
        lowest: f32::INFINITY,
        at_lowest: 0,
        highest: f32::NEG_INFINITY,
        at_highest: 0,
    };

    fn add(&mut self, hu: f32) {
        if hu < self.lowest {
            (self.lowest, self.at_lowest) = (hu, 0);
        }
        if hu > self.highest {
            (self.highest, self.at_highest) = (hu, 0);
        }
        self.at_lowest += usize::from(hu == self.lowest);
        self.at_highest += usize::from(hu == self.highest);
    }
}

impl HuCalibration {
    /// Counts what this calibration makes of a scan; `mask` (one flag per voxel) as in
    /// [`VoxelPhantom::from_volume`](crate::VoxelPhantom::from_volume).
    ///
    /// # Errors
    /// [`PhantomError`] when the calibration is not usable, the mask has the wrong length or holds no voxel at all.
    pub fn audit(&self, volume: &Volume, mask: Option<&[bool]>) -> Result<Audit, PhantomError> {
        let segmentation = Segmentation::new(self)?;
        let hu = volume.hu();
        if let Some(mask) = mask.filter(|mask| mask.len() != hu.len()) {
            return Err(PhantomError::Length {
                what: "mask values",
                found: mask.len(),
                expected: hu.len(),
            });
        }
        let spacing = volume.grid().ct_from_voxel().to_homogeneous();
        let voxel_mm3 = spacing.fixed_view::<3, 3>(0, 0).determinant().abs();
        let mut all = Range::EMPTY;
        let mut ranges: Vec<Range> = self.segments.iter().map(|_| Range::EMPTY).collect();
        let mut segments: Vec<SegmentAudit> = self
            .segments
            .iter()
            .map(|segment| SegmentAudit {
                name: segment.name.clone(),
                voxels: 0,
                volume_cm3: 0.0,
                mass_g: 0.0,
                lowest_hu: None,
                highest_hu: None,
                below_curve: 0,
                above_curve: 0,
                materials: Vec::new(),
            })
            .collect();
        let mut counts = vec![0; segmentation.materials().len()];
        let mut owner = vec![0; counts.len()];
        let mut outside_mask = 0;
        for (index, &hu) in hu.iter().enumerate() {
            if mask.is_some_and(|mask| !mask[index]) {
                outside_mask += 1;
                continue;
            }
            let voxel = segmentation.voxel(hu);
            let segment = &mut segments[voxel.segment];
            segment.voxels += 1;
            segment.mass_g += f64::from(voxel.density_g_cm3);
            if let [first, .., last] = self.segments[voxel.segment].density[..] {
                segment.below_curve += usize::from(hu < first[0]);
                segment.above_curve += usize::from(hu > last[0]);
            }
            counts[voxel.material] += 1;
            owner[voxel.material] = voxel.segment;
            ranges[voxel.segment].add(hu);
            all.add(hu);
        }
        if outside_mask == hu.len() {
            return Err(PhantomError::EmptyMask);
        }
        let voxel_cm3 = voxel_mm3 / 1_000.0;
        for (segment, range) in segments.iter_mut().zip(&ranges) {
            segment.volume_cm3 = segment.voxels as f64 * voxel_cm3;
            segment.mass_g *= voxel_cm3;
            if segment.voxels > 0 {
                segment.lowest_hu = Some(range.lowest);
                segment.highest_hu = Some(range.highest);
            }
        }
        let mut metal_cm3 = 0.0;
        for ((material, &voxels), owner) in segmentation.materials().iter().zip(&counts).zip(owner)
        {
            if voxels == 0 {
                continue;
            }
            segments[owner].materials.push(MaterialCount {
                name: material.name().to_owned(),
                voxels,
            });
            let metal: f64 = material
                .mass_fractions()
                .iter()
                .filter(|(z, _)| *z >= LIGHTEST_METAL)
                .map(|(_, fraction)| fraction)
                .sum();
            if metal > 0.5 {
                metal_cm3 += voxels as f64 * voxel_cm3;
            }
        }
        Ok(Audit {
            voxels: hu.len(),
            outside_mask,
            voxel_mm3,
            lowest_hu: all.lowest,
            voxels_at_lowest: all.at_lowest,
            highest_hu: all.highest,
            voxels_at_highest: all.at_highest,
            mass_g: segments.iter().map(|segment| segment.mass_g).sum(),
            metal_cm3,
            segments,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use ppa_ct::Grid;

    use super::*;

    /// Ten voxels whose answer is known by hand.
    #[test]
    fn voxels_are_counted_by_segment_with_volume_mass_and_limits() {
        let grid =
            Grid::axis_aligned([5, 2, 1], Vector3::new(1.0, 2.0, 5.0), Point3::origin()).unwrap();
        let hu = vec![
            -1024.0, -1024.0, -1010.0, -500.0, 30.0, 50.0, 400.0, 3071.0, 3071.0, -1000.0,
        ];
        let mut mask = vec![true; 10];
        mask[9] = false;
        let volume = Volume::new(grid, hu).unwrap();
        let calibration = HuCalibration::default();
        let audit = calibration.audit(&volume, Some(&mask)).unwrap();
        assert_eq!((audit.voxels, audit.outside_mask), (10, 1));
        assert_eq!((audit.lowest_hu, audit.voxels_at_lowest), (-1024.0, 2));
        assert_eq!((audit.highest_hu, audit.voxels_at_highest), (3071.0, 2));
        assert!((audit.voxel_mm3 - 10.0).abs() < 1e-9 && (audit.metal_cm3 - 0.02).abs() < 1e-12);
        let counts: Vec<_> = audit.segments.iter().map(|s| s.voxels).collect();
        assert_eq!(counts, [3, 1, 0, 2, 1, 2]);
        let soft = &audit.segments[3];
        let mass: f64 = [30.0, 50.0]
            .map(|hu| f64::from(calibration.density_g_cm3(hu)))
            .iter()
            .sum();
        assert!((soft.mass_g - 0.01 * mass).abs() < 1e-9);
        assert!((soft.volume_cm3 - 0.02).abs() < 1e-9);
        assert_eq!((soft.lowest_hu, soft.highest_hu), (Some(30.0), Some(50.0)));
        assert_eq!(audit.segments[2].lowest_hu, None);
        assert_eq!(audit.segments[4].materials.len(), 1);
        assert!(matches!(
            calibration.audit(&volume, Some(&[false; 10])),
            Err(PhantomError::EmptyMask)
        ));
        assert!(matches!(
            calibration.audit(&volume, Some(&[true; 3])),
            Err(PhantomError::Length { found: 3, .. })
        ));
    }

    /// A curve that ends too early is told: its last density would stand for everything above.
    #[test]
    fn voxels_beyond_the_curve_are_counted() {
        let grid = Grid::axis_aligned([4, 1, 1], Vector3::repeat(1.0), Point3::origin()).unwrap();
        let volume = Volume::new(grid, vec![-900.0, 0.0, 1500.0, 1600.0]).unwrap();
        let calibration = HuCalibration::parse(
            "[[segment]]\nname = \"all\"\nmaterial = \"water\"\ndensity = [[-800, 0.2], [1550, 2.5]]",
        )
        .unwrap();
        let audit = calibration.audit(&volume, None).unwrap();
        let all = &audit.segments[0];
        assert_eq!((all.below_curve, all.above_curve), (1, 1));
    }
}
