//! Ground truth of a phantom by construction.

use nalgebra::{Point3, Unit, Vector3};
use serde::Serialize;

use super::lower_leg::LowerLeg;
use super::lower_leg_skin::toe_tip;
use super::sdf::Plane;
use super::tibia_fibula::CORTEX_LEVELS_MM;

/// Heights in P01 at which the girths of ankle and calf are defined.
const GIRTH_LEVELS_MM: [f64; 2] = [75.0, 220.0];

/// Expected results of measurements on the voxelised phantom; `ct` frame, mm and radians.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Truth {
    /// Middle of the joint space between trochlea and plafond, both without the groove in the middle of the trochlea (1 mm deep in P01);
    /// with the groove the middle is lower by less than that.
    pub joint_centre: Point3<f64>,
    /// Direction of the tibial shaft towards the knee.
    ///
    /// A line through the centres of full slices of the leg leans about 6° further back, since the calf is
    /// behind the tibia.
    pub axis_direction: Unit<Vector3<f64>>,
    /// Axis about which the talus rotates in the mortise, towards its medial end.
    pub talocrural_axis: Unit<Vector3<f64>>,
    /// Centre of the trochlea on the talocrural axis.
    pub talocrural_centre: Point3<f64>,
    /// Internal rotation about the tibial shaft at which both malleoli are parallel to the detector.
    pub mortise_angle_rad: f64,
    /// Direction perpendicular to the shaft from the joint towards the focal spot of that view: the front of the mortise.
    pub mortise_direction: Unit<Vector3<f64>>,
    /// Internal rotation at which rays are parallel to the medial gutter.
    pub medial_gutter_angle_rad: f64,
    /// Internal rotation at which rays are parallel to the lateral gutter.
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
    /// y of the table top, which heel and calf touch.
    pub back_plane_y_mm: f64,
    /// The most anterior point of the skin: the tip of the longest toe.
    pub toe_tip: Point3<f64>,
    /// Distance from the back of the heel to the tip of the longest toe, along y.
    pub foot_length_mm: f64,
    /// Distance from the joint centre to the sole, along the shaft.
    pub sole_depth_mm: f64,
    /// Thickness of the skin.
    pub skin_mm: f64,
    /// Radius of the trochlea about the talocrural axis at its middle, without the groove.
    pub trochlea_radius_mm: f64,
    /// Gap between tibia and fibula 1 cm above the joint, 6 mm in front of and 6 mm behind the middle of the shaft; these
    /// distances are P01's and grow with the foot.
    pub syndesmosis_mm: [f64; 2],
    /// Depth of the fibular incisura of the tibia 1 cm above the joint.
    pub incisura_depth_mm: f64,
    /// Thickness of the cortex of the tibia where it faces away from the middle of the shaft: height above the joint
    /// along the shaft, thickness.
    pub tibia_cortex_mm: [[f64; 2]; 3],
    /// Hounsfield units of spongy bone in the distal tibia, away from its surface.
    pub trabecular_hu: f64,
    /// Distance of the heads of metatarsals I, III, IV and V in front of that of II, along the foot.
    pub metatarsal_heads_mm: [f64; 4],
    /// Rotation of the foot about the talocrural axis from a right angle with the leg, toes down.
    pub plantarflexion_rad: f64,
    /// Lean of the heel's lower end away from the midline.
    pub heel_valgus_rad: f64,
    /// Girths of ankle and calf: height above the joint along the shaft, girth across the shaft.
    pub girths_mm: [[f64; 2]; 2],
}

impl LowerLeg {
    /// Returns the expected results of measurements on the voxelised phantom.
    pub fn truth(&self) -> Truth {
        Truth::of(self)
    }
}

impl Truth {
    fn of(leg: &LowerLeg) -> Self {
        let p = &leg.parameters;
        let ct = &leg.ct_from_limb;
        let point = |limb: [f64; 3]| leg.on_right(ct * Point3::from(limb));
        let direction = |limb: Unit<Vector3<f64>>| {
            Unit::new_unchecked(leg.direction_on_right((ct * limb).into_inner()))
        };
        let toe_tip = leg.on_right(toe_tip(&p.drawn(), &leg.foot_placement, ct));
        Self {
            joint_centre: point([0.0; 3]),
            axis_direction: direction(Vector3::z_axis()),
            talocrural_axis: direction(leg.mortise.axis(p)),
            talocrural_centre: point(leg.mortise.point(0.0, 0.0, leg.mortise.axis_z)),
            mortise_angle_rad: p.mortise_angle_rad,
            mortise_direction: direction(leg.mortise.limb_from_mortise * -Vector3::y_axis()),
            medial_gutter_angle_rad: gutter_angle_rad(&leg.medial_facet(), 1.0),
            lateral_gutter_angle_rad: gutter_angle_rad(&leg.lateral_facet(), -1.0),
            superior_gutter_mm: p.superior_gutter_mm,
            medial_gutter_mm: p.medial_gutter_mm,
            lateral_gutter_mm: p.lateral_gutter_mm,
            trochlea_width_mm: p.trochlea_width_mm,
            medial_malleolus_mm: p.medial_malleolus_mm,
            lateral_malleolus_mm: p.lateral_malleolus_mm,
            back_plane_y_mm: leg.table_top_y,
            foot_length_mm: leg.table_top_y - toe_tip.y,
            toe_tip,
            sole_depth_mm: leg.sole_depth_mm(),
            skin_mm: p.skin_mm,
            trochlea_radius_mm: p.trochlea_radius_mm,
            syndesmosis_mm: p.syndesmosis_mm,
            incisura_depth_mm: p.incisura_depth_mm,
            tibia_cortex_mm: [0, 1, 2]
                .map(|level| [CORTEX_LEVELS_MM[level] * p.size, p.tibia_cortex_mm[level]]),
            trabecular_hu: p.trabecular_hu,
            metatarsal_heads_mm: p.metatarsal_heads_mm,
            plantarflexion_rad: p.plantarflexion_rad,
            heel_valgus_rad: p.heel_valgus_rad,
            girths_mm: GIRTH_LEVELS_MM.map(|level| {
                let height = level * p.size;
                [height, girth_mm(leg, height)]
            }),
        }
    }
}

/// Internal rotation at which rays are parallel to a facet; `side` is 1 for the medial and -1 for the lateral one.
fn gutter_angle_rad(facet: &Plane, side: f64) -> f64 {
    -(side * facet.normal.y).atan2(side * facet.normal.x)
}

/// Perimeter of the skin in the plane across the shaft at a height.
fn girth_mm(leg: &LowerLeg, height_mm: f64) -> f64 {
    const STEPS: usize = 240;
    let size = leg.parameters.size;
    // Inside every leg, between tibia and calf.
    let centre = Point3::new(-3.0 * size, 15.0 * size, height_mm);
    let outline: Vec<Vector3<f64>> = (0..STEPS)
        .map(|n| {
            let (sine, cosine) = (n as f64 / STEPS as f64 * std::f64::consts::TAU).sin_cos();
            let outwards = Vector3::new(cosine, sine, 0.0);
            let (mut inside, mut outside) = (0.0, 150.0);
            for _ in 0..30 {
                let middle = 0.5 * (inside + outside);
                if leg.envelope.skin_distance(&(centre + outwards * middle)) < 0.0 {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            outwards * inside
        })
        .collect();
    (0..STEPS)
        .map(|n| (outline[n] - outline[(n + 1) % STEPS]).norm())
        .sum()
}
