//! Audit of a HU calibration on a scan: mass of each material, and values outside the range of the scan or the calibration.

use ppa_ct::Volume;
use serde::Serialize;

use crate::matter::material::Material;
use crate::phantom::histogram::{BIN_HU, Histogram, HuBin};
use crate::phantom::hu::HuCalibration;
use crate::phantom::segment::Segment;
use crate::phantom::segmentation::Segmentation;
use crate::phantom::voxels::{PhantomError, check_mask, voxel_mm3};

/// Elements from scandium onwards count as metal.
const LIGHTEST_METAL: u8 = 21;

/// Result of applying a calibration to a scan. Voxels outside the mask are counted once and excluded from everything else.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Audit {
    /// Voxels of the scan.
    pub voxels: usize,
    /// Voxels outside the mask.
    pub outside_mask: usize,
    /// Volume of one voxel, mm³.
    pub voxel_mm3: f64,
    /// Width of the bins of all histograms, HU.
    pub bin_hu: u16,
    /// Lowest HU.
    pub lowest_hu: f32,
    /// Voxels that have exactly the lowest HU.
    pub voxels_at_lowest: usize,
    /// The same number if it is too large for the end of a tail, otherwise 0: the scan is clipped below, or filled
    /// with this value outside the field of view.
    pub clipped_below: usize,
    /// Highest HU.
    pub highest_hu: f32,
    /// Voxels that have exactly the highest HU.
    pub voxels_at_highest: usize,
    /// The same number if it is too large for the end of a tail, otherwise 0: the scan is clipped above. Metals cannot
    /// be distinguished there, and their density is that of the calibration.
    pub clipped_above: usize,
    /// Mass of all voxels, g.
    pub mass_g: f64,
    /// Volume of the metal segments, in which more than half of the mass is in elements from scandium (Z = 21) onwards, cm³.
    pub metal_cm3: f64,
    /// The segments of the calibration, from low to high HU.
    pub segments: Vec<SegmentAudit>,
}

/// Voxels of a scan that belong to one segment of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegmentAudit {
    /// Name of the segment.
    pub name: String,
    /// Number of voxels.
    pub voxels: usize,
    /// Volume of the voxels, cm³.
    pub volume_cm3: f64,
    /// Mass of the voxels, g.
    pub mass_g: f64,
    /// Lowest HU of the voxels.
    pub lowest_hu: Option<f32>,
    /// Highest HU of the voxels.
    pub highest_hu: Option<f32>,
    /// Voxels below the first knot of a density curve of two or more knots; they get the density of that knot.
    pub below_curve: usize,
    /// Voxels above the last knot of a density curve of two or more knots; they get the density of that knot.
    pub above_curve: usize,
    /// Histogram of the HU: bins with voxels, from low to high.
    pub bins: Vec<HuBin>,
    /// Materials that occur, in order of their attenuation for a mixture.
    pub materials: Vec<MaterialCount>,
}

/// Voxels of one material.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialCount {
    /// Name of the material.
    pub name: String,
    /// Number of voxels.
    pub voxels: usize,
    /// Histogram of the HU: bins with voxels, from low to high.
    pub bins: Vec<HuBin>,
}

impl HuCalibration {
    /// Applies this calibration to a scan and counts the results. `mask` has one flag per voxel, as in
    /// [`VoxelPhantom::from_volume`](crate::VoxelPhantom::from_volume).
    ///
    /// # Errors
    /// [`PhantomError`] if the calibration is invalid, or if the mask has the wrong length or is empty.
    pub fn audit(&self, volume: &Volume, mask: Option<&[bool]>) -> Result<Audit, PhantomError> {
        let segmentation = Segmentation::new(self)?;
        let hu = volume.values();
        check_mask(mask, hu.len())?;
        let voxel_mm3 = voxel_mm3(volume.grid());
        let mut segments: Vec<SegmentSums> = self.segments.iter().map(SegmentSums::new).collect();
        let mut histograms = vec![Histogram::new(); segmentation.materials().len()];
        let mut owner = vec![0; histograms.len()];
        let mut outside_mask = 0;
        for (index, hu) in hu.iter().enumerate() {
            if mask.is_some_and(|mask| !mask[index]) {
                outside_mask += 1;
                continue;
            }
            let voxel = segmentation.voxel(hu);
            segments[voxel.segment].add(hu, voxel.density_g_cm3);
            histograms[voxel.material].add(hu);
            owner[voxel.material] = voxel.segment;
        }
        let voxel_cm3 = voxel_mm3 / 1_000.0;
        let mut all = Histogram::new();
        let mut metal_cm3 = 0.0;
        for ((material, histogram), owner) in
            segmentation.materials().iter().zip(&histograms).zip(owner)
        {
            let voxels = histogram.voxels();
            if voxels == 0 {
                continue;
            }
            segments[owner].histogram.merge(histogram);
            segments[owner].materials.push(MaterialCount {
                name: material.name().to_owned(),
                voxels,
                bins: histogram.bins(),
            });
            if is_metal(material) {
                metal_cm3 += voxels as f64 * voxel_cm3;
            }
        }
        for segment in &segments {
            all.merge(&segment.histogram);
        }
        let [lowest, highest] = all.extremes().ok_or(PhantomError::EmptyMask)?;
        let segments: Vec<SegmentAudit> = segments
            .into_iter()
            .map(|sums| sums.audit(voxel_cm3))
            .collect();
        Ok(Audit {
            voxels: hu.len(),
            outside_mask,
            voxel_mm3,
            bin_hu: BIN_HU,
            lowest_hu: lowest.hu,
            voxels_at_lowest: lowest.voxels,
            clipped_below: all.pile_below(),
            highest_hu: highest.hu,
            voxels_at_highest: highest.voxels,
            clipped_above: all.pile_above(),
            mass_g: segments.iter().map(|segment| segment.mass_g).sum(),
            metal_cm3,
            segments,
        })
    }
}

fn is_metal(material: &Material) -> bool {
    let elements = material.mass_fractions().iter();
    let metal: f64 = elements
        .filter(|(z, _)| *z >= LIGHTEST_METAL)
        .map(|(_, fraction)| fraction)
        .sum();
    metal > 0.5
}

/// Sums over one segment.
struct SegmentSums<'a> {
    segment: &'a Segment,
    histogram: Histogram,
    density_g_cm3: f64,
    below_curve: usize,
    above_curve: usize,
    materials: Vec<MaterialCount>,
}

impl<'a> SegmentSums<'a> {
    fn new(segment: &'a Segment) -> Self {
        Self {
            segment,
            histogram: Histogram::new(),
            density_g_cm3: 0.0,
            below_curve: 0,
            above_curve: 0,
            materials: Vec::new(),
        }
    }

    fn add(&mut self, hu: f32, density_g_cm3: f32) {
        self.density_g_cm3 += f64::from(density_g_cm3);
        if let [first, .., last] = self.segment.density[..] {
            self.below_curve += usize::from(hu < first[0]);
            self.above_curve += usize::from(hu > last[0]);
        }
    }

    fn audit(self, voxel_cm3: f64) -> SegmentAudit {
        let voxels = self.histogram.voxels();
        let extremes = self.histogram.extremes();
        SegmentAudit {
            name: self.segment.name.clone(),
            voxels,
            volume_cm3: voxels as f64 * voxel_cm3,
            mass_g: self.density_g_cm3 * voxel_cm3,
            lowest_hu: extremes.map(|[lowest, _]| lowest.hu),
            highest_hu: extremes.map(|[_, highest]| highest.hu),
            below_curve: self.below_curve,
            above_curve: self.above_curve,
            bins: self.histogram.bins(),
            materials: self.materials,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use ppa_ct::Grid;

    use super::*;

    /// Ten voxels with a result known by hand.
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
        let bins: Vec<_> = audit.segments[0]
            .bins
            .iter()
            .map(|b| (b.from_hu, b.voxels))
            .collect();
        assert_eq!(bins, [(-1050.0, 3)]);
        for segment in &audit.segments {
            let materials = segment.materials.iter().flat_map(|material| &material.bins);
            for bins in [
                segment.bins.iter().map(|b| b.voxels).sum(),
                materials.map(|b| b.voxels).sum::<usize>(),
            ] {
                assert_eq!(bins, segment.voxels, "{}", segment.name);
            }
        }
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

    /// Forty voxels of an implant beyond the scanner's scale, in a block of muscle and bone, are found, and nothing else is.
    #[test]
    fn a_clipped_implant_is_found() {
        let grid =
            Grid::axis_aligned([20, 20, 20], Vector3::repeat(1.0), Point3::origin()).unwrap();
        let mut hu: Vec<f32> = (0..8_000).map(|i| 20.0 + (i % 500) as f32).collect();
        let audit_of = |hu: &[f32]| {
            let volume = Volume::new(grid.clone(), hu.to_vec()).unwrap();
            HuCalibration::default().audit(&volume, None).unwrap()
        };
        // A block that contains every HU equally often ends like a tail.
        let without = audit_of(&hu);
        assert_eq!((without.clipped_below, without.clipped_above), (0, 0));
        hu[4_000..4_040].fill(3_071.0);
        let with = audit_of(&hu);
        assert_eq!((with.clipped_below, with.clipped_above), (0, 40));
        assert_eq!(
            with.segments.last().unwrap().bins,
            [HuBin {
                from_hu: 3_050.0,
                voxels: 40
            }]
        );
    }

    /// A curve that ends too early is reported: its last density would apply to everything above.
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
