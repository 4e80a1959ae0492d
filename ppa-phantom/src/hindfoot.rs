//! Talus and calcaneus, and the mortise frame in which the talus sits.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use super::bone::{Bone, Filling, Gap};
use super::parameters::Parameters;
use super::placement::Placement;
use super::sdf::{Cone, Plane, Shape};
use super::trabeculae::Trabeculae;

/// The ankle mortise: medial, posterior and proximal axes rotated outwards from the limb by the mortise angle,
/// origin in the middle of the superior gutter.
#[derive(Debug, Clone)]
pub(super) struct Mortise {
    pub limb_from_mortise: Isometry3<f64>,
    /// Height of the joint axis in the middle of the trochlea.
    pub axis_z: f64,
    half_width: f64,
    half_wedge: f64,
    /// Height at which the width of the trochlea is defined.
    width_level: f64,
}

/// Height in P01, from the joint centre, at which the width of the trochlea is defined.
pub(super) const WIDTH_LEVEL_MM: f64 = -4.0;
/// Distance from the joint centre of P01 down to the sole.
pub(super) const SOLE_DEPTH_MM: f64 = 83.0;

impl Mortise {
    pub(super) fn new(p: &Parameters) -> Self {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -p.mortise_angle_rad);
        Self {
            limb_from_mortise: Isometry3::from_parts(Translation3::identity(), turn),
            axis_z: -0.5 * p.superior_gutter_mm
                - p.trochlea_radius_mm * p.axis_inclination_rad.cos(),
            half_width: 0.5 * p.trochlea_width_mm,
            half_wedge: 0.5 * p.trochlea_wedge_rad,
            width_level: WIDTH_LEVEL_MM * p.size,
        }
    }

    /// Limb coordinates of a point given as medial, posterior, proximal.
    pub(super) fn point(&self, medial: f64, posterior: f64, proximal: f64) -> [f64; 3] {
        (self.limb_from_mortise * Point3::new(medial, posterior, proximal))
            .coords
            .into()
    }

    /// An ellipsoid along the mortise axes.
    pub(super) fn ellipsoid(&self, centre: [f64; 3], semi: [f64; 3]) -> Shape {
        let [m, p, z] = centre;
        Shape::turned_ellipsoid(
            self.point(m, p, z),
            semi,
            self.limb_from_mortise.rotation.to_rotation_matrix(),
        )
    }

    /// The talocrural axis towards its medial end.
    pub(super) fn axis(&self, p: &Parameters) -> Unit<Vector3<f64>> {
        let (sine, cosine) = p.axis_inclination_rad.sin_cos();
        self.limb_from_mortise * Unit::new_unchecked(Vector3::new(cosine, 0.0, sine))
    }

    /// Plantarflexion of the foot.
    pub(super) fn flexion(&self, p: &Parameters) -> Placement {
        let turn = UnitQuaternion::from_axis_angle(&self.axis(p), p.plantarflexion_rad);
        Placement::rotation_wrt_point(turn, self.point(0.0, 0.0, self.axis_z).into(), 1.0)
    }

    /// Position of the trochlear groove along the talocrural axis, from its middle: below the middle of the dome.
    ///
    /// The dome above a point `a` of the axis, of radius R - a tan(i), is a cos(i) - (R - a tan(i)) sin(i) medial of
    /// the middle, since the axis is inclined by i.
    pub(super) fn groove_at(&self, p: &Parameters) -> f64 {
        let (sine, cosine) = p.axis_inclination_rad.sin_cos();
        p.trochlea_radius_mm * sine * cosine
    }

    /// The cone of the trochlea.
    pub(super) fn cone(&self, p: &Parameters) -> Shape {
        Shape::Cone(Cone {
            centre: self.point(0.0, 0.0, self.axis_z).into(),
            axis: self.axis(p),
            radius: p.trochlea_radius_mm,
            taper: p.axis_inclination_rad.tan(),
            groove_depth: p.trochlea_groove_mm,
            groove_at: self.groove_at(p),
            crest: 0.75 * self.half_width,
        })
    }

    /// Plane of a facet; `side` is 1 for the medial and -1 for the lateral one.
    fn facet(&self, side: f64, slope_rad: f64) -> Plane {
        let (wedge, slope) = (self.half_wedge.sin_cos(), slope_rad.sin_cos());
        let normal = Unit::new_normalize(Vector3::new(
            side * wedge.1 * slope.1,
            wedge.0 * slope.1,
            slope.0,
        ));
        let on_facet = Vector3::new(side * self.half_width, 0.0, self.width_level);
        Plane {
            normal: self.limb_from_mortise * normal,
            offset: normal.dot(&on_facet),
        }
    }

    /// Plane of the medial facet, normal away from the talus.
    pub(super) fn medial_facet(&self, p: &Parameters) -> Plane {
        self.facet(1.0, p.medial_facet_slope_rad)
    }

    /// Plane of the lateral facet, normal away from the talus.
    pub(super) fn lateral_facet(&self, p: &Parameters) -> Plane {
        self.facet(-1.0, p.lateral_facet_slope_rad)
    }

    /// Half-space behind a plane through a point; both given along the mortise axes.
    pub(super) fn wall(&self, outwards: [f64; 3], through: [f64; 3]) -> Shape {
        let normal = Unit::new_normalize(Vector3::from(outwards));
        Shape::HalfSpace(Plane {
            normal: self.limb_from_mortise * normal,
            offset: normal.dot(&Vector3::from(through)),
        })
    }
}

/// Trochlea with lateral and posterior process, neck and head.
pub(super) fn talus(p: &Parameters, mortise: &Mortise) -> Bone {
    let block = Shape::common(
        2.0,
        vec![
            mortise.cone(p),
            mortise.wall([0.0, -1.0, 0.0], [0.0, -17.0, 0.0]),
            mortise.wall([0.0, 1.0, 0.0], [0.0, 16.5, 0.0]),
            mortise.wall([0.0, 0.0, -1.0], [0.0, 0.0, -27.0]),
            // Below the comma of the medial facet the body recedes.
            mortise.wall([0.8, 0.0, -0.6], [17.5 + p.side_shift_mm(), 0.0, -15.0]),
        ],
    );
    let at = |m, b, z| mortise.point(m, b, z);
    let body = Shape::union(
        4.0,
        vec![
            block,
            Shape::round_cone(at(-10.0, 1.0, -20.0), 8.0, at(-18.0, 0.0, -26.5), 3.5),
            Shape::round_cone(at(0.0, 12.0, -20.0), 8.0, at(2.0, 20.0, -22.5), 3.5),
        ],
    );
    let body = Shape::common(
        2.0,
        vec![
            body,
            Shape::HalfSpace(mortise.medial_facet(p)),
            Shape::HalfSpace(mortise.lateral_facet(p)),
        ],
    );
    let head = [7.5, -29.0, -25.0];
    let solid = Shape::union(
        5.0,
        vec![
            body,
            Shape::round_cone(at(0.0, -10.0, -18.0), 10.5, [6.0, -24.0, -24.0], 10.5),
            Shape::turned_ellipsoid(
                head,
                [15.5, 14.5, 11.0],
                Rotation3::from_axis_angle(&Vector3::y_axis(), 30.0_f64.to_radians()),
            ),
        ],
    );
    let mean_hu = p.spongy_hu(380.0);
    // Along the leg, as the load (DeSilva and Devlin 2012: well ordered throughout the talus); numbers assumed.
    let trabeculae = Trabeculae::new(mean_hu, 0.55, 1.6);
    Bone {
        name: "talus",
        solid,
        hollows: vec![],
        yields_to: vec![],
        filling: Filling::spongy(0.8, mean_hu, trabeculae),
        joints: vec![],
    }
}

/// Tuberosity, body, sustentaculum and anterior process.
pub(super) fn calcaneus(p: &Parameters, talus: usize) -> Bone {
    let floor = 18.0 - SOLE_DEPTH_MM; // the heel pad is 18 mm
    let solid = Shape::union(
        8.0,
        vec![
            Shape::ellipsoid([-4.0, 36.0, floor + 20.5], [14.0, 13.5, 20.5]),
            Shape::round_cone(
                [-4.0, 26.0, floor + 19.0],
                14.5,
                [-11.0, -18.0, floor + 22.5],
                11.5,
            ),
            Shape::ellipsoid([-8.0, 4.0, floor + 31.0], [13.0, 17.0, 12.0]),
            Shape::ellipsoid([-12.0, -24.0, floor + 22.0], [12.0, 13.0, 12.0]),
            Shape::ellipsoid([9.0, -4.0, floor + 26.0], [11.0, 10.0, 5.5]),
        ],
    );
    let mean_hu = p.spongy_hu(230.0);
    // From the posterior facet down and back to the tuberosity, where they run backwards (Souzanchi 2012, PMC3500573).
    // Anisotropy in radiographs 1.72 ± 0.18 (BMC Med Imaging 2005;5:4); a separation of 0.67 mm is assumed.
    let trabeculae = Trabeculae::new(mean_hu, 0.67, 1.7).around(
        Point3::new(-4.0, 60.0, floor + 62.0),
        &Vector3::x_axis(),
        Point3::new(-4.0, 18.0, floor + 21.0),
    );
    let bone = Bone {
        name: "calcaneus",
        solid,
        hollows: vec![],
        yields_to: vec![(talus, Gap::even(p.small_joint_mm))],
        filling: Filling::spongy(0.8, mean_hu, trabeculae),
        joints: vec![],
    };
    bone.placed(&heel_valgus(p))
}

/// Rotation of the heel about the line along which it carries the talus.
pub(super) fn heel_valgus(p: &Parameters) -> Placement {
    let pivot = Point3::new(-4.0, 10.0, 38.0 - SOLE_DEPTH_MM);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), p.heel_valgus_rad);
    Placement::rotation_wrt_point(turn, pivot, 1.0)
}
