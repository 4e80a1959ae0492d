//! A limb of known shape: bones in soft tissue, modelled as a right limb.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use ppa_core::Side;

use super::bone::Skeleton;
use super::envelope::Envelope;
use super::plate::Plate;
use super::texture::Texture;
use super::tissue::Tissue;

/// Field of view of a scan, mm from the middle of the joint along x, y and z.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScanRange {
    pub low: [f64; 3],
    pub high: [f64; 3],
    /// Levels at which the limb leaves the scan: distal, proximal.
    pub cut: [Option<f64>; 2],
}

/// A limb whose tissue is known at every point.
///
/// Frame of all points: `ct` (LPS, mm).
#[derive(Debug, Clone)]
pub struct Limb {
    pub(super) side: Side,
    /// Limb frame: origin at the joint centre, z along the shaft, x and y as in the `ct` of a right limb.
    pub(super) ct_from_limb: Isometry3<f64>,
    pub(super) skeleton: Skeleton,
    pub(super) envelope: Envelope,
    pub(super) plate: Option<Plate>,
    pub(super) scan: ScanRange,
    /// Height of the table top, `ct` y in mm.
    pub(super) table_top_y: f64,
    /// Standard deviation of spongy bone between voxels of 0.8 mm, relative to the contribution of its trabeculae above marrow.
    pub(super) texture_share: f64,
    /// Spatial pattern of the density of spongy bone.
    pub(super) texture: Texture,
}

impl Limb {
    /// Maps a point to the right limb, of which a left one is the mirror image.
    pub(super) fn on_right(&self, mut p: Point3<f64>) -> Point3<f64> {
        if self.side == Side::Left {
            p.x = -p.x;
        }
        p
    }

    pub(super) fn direction_on_right(&self, v: Vector3<f64>) -> Vector3<f64> {
        self.on_right(v.into()).coords
    }

    pub(super) fn limb_from_right(&self, p_right: &Point3<f64>) -> Point3<f64> {
        self.ct_from_limb.inverse_transform_point(p_right)
    }

    pub(super) fn limb_point(&self, p_ct: &Point3<f64>) -> Point3<f64> {
        self.limb_from_right(&self.on_right(*p_ct))
    }

    /// Side of the body.
    pub fn side(&self) -> Side {
        self.side
    }

    /// Height of the table top on which the limb rests, `ct` y in mm.
    pub fn table_top_mm(&self) -> f64 {
        self.table_top_y
    }

    /// Signed distance from a point of the `ct` frame to the skin in mm, negative inside.
    ///
    /// Exact on the skin and to first order near it; farther away an estimate with the right sign.
    /// The limb continues beyond the field of view of [`Limb::voxelise`].
    pub fn skin_distance_mm(&self, p: &Point3<f64>) -> f64 {
        self.envelope.skin_distance(&self.limb_point(p))
    }

    /// Unit normal of the skin, outwards, at a point on or near it.
    pub fn skin_normal(&self, p: &Point3<f64>) -> Unit<Vector3<f64>> {
        /// Small compared with every radius, large compared with rounding: the normal is accurate to 1e-6.
        const STEP_MM: f64 = 1e-3;
        let slope = |axis| {
            let step = Vector3::ith(axis, STEP_MM);
            self.skin_distance_mm(&(p + step)) - self.skin_distance_mm(&(p - step))
        };
        Unit::new_normalize(Vector3::new(slope(0), slope(1), slope(2)))
    }

    /// Returns the tissue at a point of the `ct` frame.
    pub fn tissue(&self, p: &Point3<f64>) -> Tissue {
        self.tissue_in_limb(&self.limb_point(p))
    }

    /// The anatomical name of the bone at a point of the `ct` frame, such as `"talus"`.
    pub fn bone(&self, p: &Point3<f64>) -> Option<&'static str> {
        let (bone, _) = self.skeleton.bone_at(&self.limb_point(p))?;
        Some(self.skeleton.bones()[bone].name)
    }

    /// Bounding box of the skin in the `ct` frame of the right limb, within the field of view.
    ///
    /// Found on a coarse lattice, so too large by up to one step of it.
    pub(super) fn skin_box(&self) -> (Point3<f64>, Point3<f64>) {
        const STEP_MM: f64 = 5.0;
        let centre = self.ct_from_limb * Point3::origin();
        let steps = |axis: usize| {
            let [low, high] = [self.scan.low[axis], self.scan.high[axis]];
            (low / STEP_MM) as i32..=(high / STEP_MM) as i32
        };
        let mut low = Point3::from(Vector3::repeat(f64::INFINITY));
        let mut high = -low;
        for k in steps(2) {
            for j in steps(1) {
                for i in steps(0) {
                    let p = centre + Vector3::new(i.into(), j.into(), k.into()) * STEP_MM;
                    if self.envelope.skin_distance(&self.limb_from_right(&p)) < STEP_MM {
                        low = low.inf(&p);
                        high = high.sup(&p);
                    }
                }
            }
        }
        if let Some(distal) = self.scan.cut[0] {
            low.z = centre.z + distal;
        }
        if let Some(proximal) = self.scan.cut[1] {
            high.z = centre.z + proximal;
        }
        (low, high)
    }
}
