//! Parameters of a phantom.

use serde::Deserialize;

/// Sex whose averages a phantom is drawn around.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sex {
    /// Adult women.
    Female,
    /// Adult men.
    Male,
}

/// Dimensions of a right lower leg and foot; mm and radians.
///
/// Sources: talus, mortise, malleoli and syndesmosis from the CT and cadaver studies cited at the fields
/// (mean ± SD); dimensions without a citation are chosen within the range of adult anatomy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parameters {
    pub sex: Sex,
    /// Size of all lengths without a field of their own, relative to P01.
    pub size: f64,
    /// Internal rotation at which both malleoli are parallel to the detector: 19.1° ± 5.0°, n = 128 feet.
    pub mortise_angle_rad: f64,
    /// Bony gap between trochlea and plafond: 2.89 ± 0.56 (Zhang 2014).
    pub superior_gutter_mm: f64,
    /// Bony gap between talus and medial malleolus: 2.56 ± 0.50 (Goker 2009).
    pub medial_gutter_mm: f64,
    /// Bony gap between talus and lateral malleolus: 2.45 ± 0.55 (Goker 2009).
    pub lateral_gutter_mm: f64,
    /// Bony gap between tibia and fibula at the front and at the back of the incisura: 2.2 ± 0.9 and 3.5 ± 0.9
    /// (n = 203); mean of both 2.7 ± 0.8 (PMC7937306).
    pub syndesmosis_mm: [f64; 2],
    /// Depth of the incisura below the tubercles that flank it, at the plafond: 3.3 ± 1.2 (n = 203).
    pub incisura_depth_mm: f64,
    /// Sagittal radius of the trochlea: 20.7 ± 2.6 over both sexes (PMC1888582), or 21.8 in men.
    pub trochlea_radius_mm: f64,
    /// Width of the trochlea half-way along it: 27.9 ± 3.0 over both sexes (PMC1888582), or 29.4 in men.
    pub trochlea_width_mm: f64,
    /// Angle between its medial and lateral facet; 29.9 mm in front and 25.2 mm behind (PMC1888582) would
    /// be 9.0°, within the spread of both widths.
    pub trochlea_wedge_rad: f64,
    /// Depth of the groove between its crests: 1.3 in front, 0.6 behind (Thai J Surg).
    pub trochlea_groove_mm: f64,
    /// Height of the medial end of the talocrural axis above the lateral end, as an angle; dome
    /// inclination 9.9° ± 3.3° (BioMed Res Int 2019:8634159).
    pub axis_inclination_rad: f64,
    /// Slope of the medial facet away from the vertical; tibia and medial malleolus enclose 114° (PMC3117279).
    pub medial_facet_slope_rad: f64,
    /// Slope of the lateral facet away from the vertical.
    pub lateral_facet_slope_rad: f64,
    /// Reach of the medial malleolus below the joint line: 15.3 ± 1.0 (Patil 2012).
    pub medial_malleolus_mm: f64,
    /// Reach of the lateral malleolus below the joint line: 27.4 ± 3.8 (Patil 2012).
    pub lateral_malleolus_mm: f64,
    /// Distance of the heads of metatarsals I, III, IV and V in front of that of II: 0.9 ± 2.7, -4.4 ± 1.6,
    /// -11.2 ± 2.2, -20.2 ± 3.8 (PMC3932714).
    pub metatarsal_heads_mm: [f64; 4],
    /// Cortex of the tibia 25, 100 and 200 mm above the joint of a leg of P01's size: 0.5–1.5, 2–4 and 4–6, growing
    /// towards mid-shaft (PMC2849524 for the trend).
    pub tibia_cortex_mm: [f64; 3],
    /// HU of spongy bone in the distal tibia; 290 mg/cm³ (PubMed 23103330). Other bones in proportion.
    pub trabecular_hu: f64,
    /// Standard deviation of spongy bone in the distal tibia between voxels of 0.8 mm, HU; other bones in proportion.
    pub trabecular_texture_hu: f64,
    /// Seed of the density pattern of spongy bone.
    pub texture_seed: u64,
    /// Girth of the leg just above the malleoli, relative to P01's at the same size.
    pub ankle_girth: f64,
    /// Girth of the calf, relative to P01's at the same size.
    pub calf_girth: f64,
    /// Plantarflexion from a right angle between foot and leg.
    pub plantarflexion_rad: f64,
    /// Rotation of the heel's lower end away from the midline.
    pub heel_valgus_rad: f64,
    /// Gap between the bones of the other joints.
    pub small_joint_mm: f64,
    /// Thickness of the skin; finite-element models use 2.0, measured values are 0.5 to 2.
    pub skin_mm: f64,
    /// Length of lower leg inside the scan, from the joint centre proximally.
    pub leg_length_mm: f64,
    /// Position of the joint centre in the scanner.
    pub joint_centre_ct_mm: [f64; 3],
}

/// Phantom P01: an average adult male.
pub(super) const P01: Parameters = Parameters {
    sex: Sex::Male,
    size: 1.0,
    mortise_angle_rad: 18.0_f64.to_radians(),
    superior_gutter_mm: 2.8,
    medial_gutter_mm: 2.5,
    lateral_gutter_mm: 2.5,
    syndesmosis_mm: [2.7, 2.7],
    incisura_depth_mm: 4.8,
    trochlea_radius_mm: 21.8,
    trochlea_width_mm: 29.4,
    trochlea_wedge_rad: 6.0_f64.to_radians(),
    trochlea_groove_mm: 1.0,
    axis_inclination_rad: 8.0_f64.to_radians(),
    medial_facet_slope_rad: 24.0_f64.to_radians(),
    lateral_facet_slope_rad: 10.0_f64.to_radians(),
    medial_malleolus_mm: 15.3,
    lateral_malleolus_mm: 26.5,
    metatarsal_heads_mm: [-0.5, -4.5, -11.0, -19.5],
    tibia_cortex_mm: [1.2, 3.6, 4.8],
    trabecular_hu: 280.0,
    trabecular_texture_hu: 70.0,
    texture_seed: 0,
    ankle_girth: 1.0,
    calf_girth: 1.0,
    plantarflexion_rad: 0.0,
    heel_valgus_rad: 0.0,
    small_joint_mm: 1.8,
    skin_mm: 1.5,
    leg_length_mm: 250.0,
    joint_centre_ct_mm: [-92.0, 14.0, -310.0],
};

/// The foot for which the tables of sections were drawn: bones and skin are shifted by the difference from it.
pub(super) const TABLES: Parameters = Parameters {
    trochlea_width_mm: 27.9,
    medial_facet_slope_rad: 20.0_f64.to_radians(),
    ..P01
};

impl Parameters {
    /// The parameters before resizing: every length divided by `size`.
    pub(super) fn drawn(&self) -> Self {
        let mm = |length: f64| length / self.size;
        Self {
            size: 1.0,
            superior_gutter_mm: mm(self.superior_gutter_mm),
            medial_gutter_mm: mm(self.medial_gutter_mm),
            lateral_gutter_mm: mm(self.lateral_gutter_mm),
            syndesmosis_mm: self.syndesmosis_mm.map(mm),
            incisura_depth_mm: mm(self.incisura_depth_mm),
            trochlea_radius_mm: mm(self.trochlea_radius_mm),
            trochlea_width_mm: mm(self.trochlea_width_mm),
            trochlea_groove_mm: mm(self.trochlea_groove_mm),
            medial_malleolus_mm: mm(self.medial_malleolus_mm),
            lateral_malleolus_mm: mm(self.lateral_malleolus_mm),
            metatarsal_heads_mm: self.metatarsal_heads_mm.map(mm),
            tibia_cortex_mm: self.tibia_cortex_mm.map(mm),
            small_joint_mm: mm(self.small_joint_mm),
            skin_mm: mm(self.skin_mm),
            leg_length_mm: mm(self.leg_length_mm),
            ..*self
        }
    }

    /// HU of spongy bone that is `p01_hu` in P01.
    pub(super) fn spongy_hu(&self, p01_hu: f64) -> f64 {
        p01_hu * (self.trabecular_hu / P01.trabecular_hu)
    }

    /// Outward shift of the lateral malleolus and everything attached to it, relative to the tables.
    pub(super) fn lateral_shift_mm(&self) -> f64 {
        self.side_shift_mm() + self.lateral_gutter_mm - TABLES.lateral_gutter_mm
    }

    /// The same for the medial malleolus.
    pub(super) fn medial_shift_mm(&self) -> f64 {
        self.side_shift_mm() + self.medial_gutter_mm - TABLES.medial_gutter_mm
    }

    /// Outward shift of the medial facet relative to the tables due to its larger slope, at this depth below the level of
    /// its width.
    pub(super) fn medial_lean_mm(&self, depth_mm: f64) -> f64 {
        depth_mm * (self.medial_facet_slope_rad.tan() - TABLES.medial_facet_slope_rad.tan())
    }

    /// Outward shift of each facet of the trochlea relative to the tables.
    pub(super) fn side_shift_mm(&self) -> f64 {
        0.5 * (self.trochlea_width_mm - TABLES.trochlea_width_mm)
    }
}
