//! What is true about a phantom by construction.

use nalgebra::{Point3, Unit, Vector3};

use super::LowerLeg;

/// Numbers that a measurement on the voxelised phantom should find; `ct` frame, mm and radians.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Truth {
    /// Middle of the joint space between trochlea and plafond.
    pub joint_centre: Point3<f64>,
    /// Direction of the tibial shaft towards the knee.
    ///
    /// A line through the centres of whole slices of the leg leans about 6° further back, since the calf lies
    /// behind the tibia.
    pub axis_direction: Unit<Vector3<f64>>,
    /// Axis about which the talus turns in the mortise, towards its medial end.
    pub talocrural_axis: Unit<Vector3<f64>>,
    /// Centre of the trochlea on the talocrural axis.
    pub talocrural_centre: Point3<f64>,
    /// Internal rotation about the tibial shaft that turns both malleoli parallel to the detector.
    pub mortise_angle_rad: f64,
    /// Internal rotation at which rays run along the medial gutter.
    pub medial_gutter_angle_rad: f64,
    /// Internal rotation at which rays run along the lateral gutter.
    pub lateral_gutter_angle_rad: f64,
    /// Bony gap between trochlea and plafond.
    pub superior_gutter_mm: f64,
    /// Bony gap between talus and medial malleolus.
    pub medial_gutter_mm: f64,
    /// Bony gap between talus and lateral malleolus.
    pub lateral_gutter_mm: f64,
    /// Width of the trochlea half-way along it.
    pub trochlea_width_mm: f64,
    /// Reach of the medial malleolus below the joint centre, along the shaft.
    pub medial_malleolus_mm: f64,
    /// Reach of the lateral malleolus below the joint centre, along the shaft.
    pub lateral_malleolus_mm: f64,
    /// Plane under the limb, which heel and calf touch: y of the table top.
    pub back_plane_y_mm: f64,
    /// The most anterior point of the skin: the tip of the big toe.
    pub toe_tip: Point3<f64>,
    /// From the back of the heel to the tip of the longest toe, along y.
    pub foot_length_mm: f64,
    /// From the joint centre to the sole, along the shaft.
    pub sole_depth_mm: f64,
    /// Thickness of the skin.
    pub skin_mm: f64,
}

impl Truth {
    pub(super) fn of(limb: &LowerLeg) -> Self {
        let p = &limb.parameters;
        let ct = &limb.ct_from_limb;
        let toe_tip = limb.envelope.toe_tip(ct);
        let half_wedge = 0.5 * p.trochlea_wedge_rad;
        Self {
            joint_centre: ct * Point3::origin(),
            axis_direction: ct * Vector3::z_axis(),
            talocrural_axis: ct * limb.mortise.axis(p),
            talocrural_centre: ct * Point3::from(limb.mortise.point(0.0, 0.0, limb.mortise.axis_z)),
            mortise_angle_rad: p.mortise_angle_rad,
            medial_gutter_angle_rad: p.mortise_angle_rad - half_wedge,
            lateral_gutter_angle_rad: p.mortise_angle_rad + half_wedge,
            superior_gutter_mm: p.superior_gutter_mm,
            medial_gutter_mm: p.medial_gutter_mm,
            lateral_gutter_mm: p.lateral_gutter_mm,
            trochlea_width_mm: p.trochlea_width_mm,
            medial_malleolus_mm: p.medial_malleolus_mm,
            lateral_malleolus_mm: p.lateral_malleolus_mm,
            back_plane_y_mm: limb.table_top_y(),
            foot_length_mm: limb.table_top_y() - toe_tip.y,
            toe_tip,
            sole_depth_mm: p.sole_depth_mm,
            skin_mm: p.skin_mm,
        }
    }
}

impl LowerLeg {
    /// A box in the `ct` frame around the skin, from the toes to the proximal end of the scan.
    ///
    /// Found on a coarse lattice, so up to one step of it too large.
    pub(super) fn skin_box(&self) -> (Point3<f64>, Point3<f64>) {
        const STEP_MM: f64 = 5.0;
        let centre = self.ct_from_limb * Point3::origin();
        let top = self.parameters.leg_length_mm;
        let reach = [(-20, 20), (-50, 20), (-22, (top / STEP_MM) as i32)];
        let mut low = Point3::from(Vector3::repeat(f64::INFINITY));
        let mut high = -low;
        for k in reach[2].0..=reach[2].1 {
            for j in reach[1].0..=reach[1].1 {
                for i in reach[0].0..=reach[0].1 {
                    let p = centre + Vector3::new(i.into(), j.into(), k.into()) * STEP_MM;
                    if self.skin_distance_mm(&p) < STEP_MM {
                        low = low.inf(&p);
                        high = high.sup(&p);
                    }
                }
            }
        }
        high.z = centre.z + top;
        (low, high)
    }
}
