//! The numbers that make one phantom.

/// Dimensions of a right lower leg and foot; mm and radians.
///
/// Sources: talus, mortise, malleoli and syndesmosis from the CT and cadaver studies named at the fields
/// (mean ± SD); dimensions without a name are chosen within the range of adult anatomy.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parameters {
    /// Internal rotation that turns both malleoli parallel to the detector: 19.1° ± 5.0°, n = 128 feet.
    pub mortise_angle_rad: f64,
    /// Bony gap between trochlea and plafond: 2.89 ± 0.56 (Zhang 2014).
    pub superior_gutter_mm: f64,
    /// Bony gap between talus and medial malleolus: 2.56 ± 0.50 (Goker 2009).
    pub medial_gutter_mm: f64,
    /// Bony gap between talus and lateral malleolus: 2.45 ± 0.55 (Goker 2009).
    pub lateral_gutter_mm: f64,
    /// Bony gap between tibia and fibula in the incisura: 2.7 ± 0.8 (PMC7937306).
    pub syndesmosis_mm: f64,
    /// Sagittal radius of the trochlea: 20.7 ± 2.6 (PMC1888582).
    pub trochlea_radius_mm: f64,
    /// Width of the trochlea half-way along it: 27.9 ± 3.0 (PMC1888582).
    pub trochlea_width_mm: f64,
    /// Angle between its medial and lateral facet; 29.9 mm in front and 25.2 mm behind (PMC1888582) would
    /// be 9.0°, within the spread of both widths.
    pub trochlea_wedge_rad: f64,
    /// Depth of the groove between its crests: 1.3 in front, 0.6 behind (Thai J Surg).
    pub trochlea_groove_mm: f64,
    /// How far the lateral end of the talocrural axis lies below the level of the medial end.
    pub axis_inclination_rad: f64,
    /// Slope of the medial facet away from the vertical; tibia and medial malleolus enclose 114° (PMC3117279).
    pub medial_facet_slope_rad: f64,
    /// Slope of the lateral facet away from the vertical.
    pub lateral_facet_slope_rad: f64,
    /// Reach of the medial malleolus below the joint line: 15.3 ± 1.0 (Patil 2012).
    pub medial_malleolus_mm: f64,
    /// Reach of the lateral malleolus below the joint line: 27.4 ± 3.8 (Patil 2012).
    pub lateral_malleolus_mm: f64,
    /// Gap between the bones of the other joints.
    pub small_joint_mm: f64,
    /// From the joint centre down to the sole.
    pub sole_depth_mm: f64,
    /// Thickness of the skin; finite-element models use 2.0, measured values are 0.5 to 2.
    pub skin_mm: f64,
    /// Rise of the tibial axis from the table towards the knee.
    pub leg_rise_rad: f64,
    /// From the joint centre back to the table top, across the table.
    pub table_depth_mm: f64,
    /// Length of lower leg inside the scan, from the joint centre proximally.
    pub leg_length_mm: f64,
    /// Place of the joint centre in the scanner.
    pub joint_centre_ct_mm: [f64; 3],
}

impl Parameters {
    /// Phantom P01: an average adult male.
    pub(super) fn p01() -> Self {
        Self {
            mortise_angle_rad: 18.0_f64.to_radians(),
            superior_gutter_mm: 2.8,
            medial_gutter_mm: 2.5,
            lateral_gutter_mm: 2.5,
            syndesmosis_mm: 2.7,
            trochlea_radius_mm: 20.7,
            trochlea_width_mm: 27.9,
            trochlea_wedge_rad: 6.0_f64.to_radians(),
            trochlea_groove_mm: 1.0,
            axis_inclination_rad: 8.0_f64.to_radians(),
            medial_facet_slope_rad: 20.0_f64.to_radians(),
            lateral_facet_slope_rad: 10.0_f64.to_radians(),
            medial_malleolus_mm: 15.3,
            lateral_malleolus_mm: 26.5,
            small_joint_mm: 1.8,
            sole_depth_mm: 83.0,
            skin_mm: 1.5,
            leg_rise_rad: 3.0_f64.to_radians(),
            table_depth_mm: 58.0,
            leg_length_mm: 250.0,
            joint_centre_ct_mm: [-92.0, 14.0, -310.0],
        }
    }
}
