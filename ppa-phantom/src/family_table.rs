//! Published means and spreads of the dimensions, and the table of phantoms P01 to P17.

use super::parameters::Sex;

/// How a dimension is distributed among adults.
pub(super) struct Dimension {
    /// Mean and standard deviation of men.
    pub men: [f64; 2],
    /// The same of women, where sources distinguish them.
    pub women: Option<[f64; 2]>,
    /// Whether the numbers above are those of a foot of P01's size, to be multiplied by the size.
    pub grows: bool,
    /// The least and the most that is drawn, in the units of the numbers above.
    pub range: [f64; 2],
}

impl Dimension {
    const fn of(mean: f64, deviation: f64) -> Self {
        Self {
            men: [mean, deviation],
            women: None,
            grows: false,
            range: [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// A length that grows with the foot.
    const fn length(mean: f64, deviation: f64) -> Self {
        Self {
            grows: true,
            ..Self::of(mean, deviation)
        }
    }

    const fn by_sex(men: [f64; 2], women: [f64; 2]) -> Self {
        Self {
            women: Some(women),
            ..Self::of(men[0], men[1])
        }
    }

    const fn between(self, least: f64, most: f64) -> Self {
        Self {
            range: [least, most],
            ..self
        }
    }

    pub(super) fn mean_and_deviation(&self, sex: Sex) -> [f64; 2] {
        match (sex, self.women) {
            (Sex::Female, Some(women)) => women,
            _ => self.men,
        }
    }
}

/// One value per entry of [`DIMENSIONS`]; mm, degrees, HU, or a share.
pub(super) type Dimensions = [f64; 31];

/// What the columns of [`FAMILY`] are, and where mean and spread come from.
///
/// Spreads of lengths are what is left of the published one when a spread of size of 5 % within and 10 % between the
/// sexes is taken out. "Chosen" marks numbers without a published source.
pub(super) const DIMENSIONS: [Dimension; 31] = [
    // Size: length of the talus, men 60.9 ± 2.8, women 54.4 ± 2.5 (J Jilin Univ Med 2020;46:102).
    Dimension::by_sex([1.0, 0.046], [0.893, 0.041]),
    // Mortise angle: men 21.2 ± 4.6, women 16.4 ± 4.1, all within 10 to 29 (CT of 128 feet, 2001).
    Dimension::by_sex([21.2, 4.6], [16.4, 4.1]).between(10.0, 29.0),
    // Inclination of the talocrural axis: 9.9 ± 3.3 (BioMed Res Int 2019:8634159).
    Dimension::of(9.9, 3.3),
    // Radius and width of the trochlea: 20.7 ± 2.6 and 27.9 ± 3.0 over 11 men and 10 women (PMC1888582). With both sexes in
    // proportion to their sizes, those of men are larger by 21 / (11 + 10 x 0.893).
    Dimension::length(21.8, 1.6),
    Dimension::length(29.4, 2.0),
    // Wedge of the trochlea: from 29.9 to 25.2 mm it is 9.0 (PMC1888582); chosen between that and parallel facets.
    Dimension::of(7.0, 1.5),
    // Groove: 1.3 in front, 0.6 behind (Thai J Surg).
    Dimension::length(0.95, 0.2),
    // Slopes of the medial and the lateral facet: medial 114 - 90, since plafond and medial malleolus enclose 114, their
    // bisector 57 ± 3 (PMC3117279); its spread and the lateral one chosen.
    Dimension::of(24.0, 2.0),
    Dimension::of(10.0, 1.5),
    // Gutters: superior 2.89 ± 0.56 (Zhang 2014), medial 2.56 ± 0.50, lateral 2.45 ± 0.55 (PMC2706360); men's are wider.
    Dimension::length(3.0, 0.5),
    Dimension::length(2.65, 0.45),
    Dimension::length(2.55, 0.5),
    // Malleoli: 15.3 ± 1.0 and 27.4 ± 3.8 (Patil 2012).
    Dimension::length(16.0, 0.8),
    Dimension::length(28.0, 2.6),
    // Syndesmosis in front and behind: 2.2 ± 0.9, 3.5 ± 0.9; incisura 3.3 ± 1.2 (CT of 203 legs).
    // Less in front would make the bones touch.
    Dimension::length(2.2, 0.9).between(1.2, f64::INFINITY),
    Dimension::length(3.5, 0.9),
    Dimension::length(3.3, 1.2),
    // Heads of metatarsals I, III, IV, V in front of that of II (PMC3932714).
    Dimension::length(0.9, 2.7),
    Dimension::length(-4.4, 1.6),
    Dimension::length(-11.2, 2.2),
    Dimension::length(-20.2, 3.8),
    // Cortex of the tibia, metaphysis to shaft; levels chosen, trend PMC2849524.
    Dimension::length(1.2, 0.12),
    Dimension::length(3.6, 0.4),
    Dimension::length(4.8, 0.5),
    // Spongy bone: 290 mg/cm³ (PubMed 23103330) reads as 280 HU; spread and texture chosen.
    Dimension::of(280.0, 40.0),
    Dimension::of(45.0, 10.0),
    // Girths of ankle and calf relative to P01: spreads chosen.
    Dimension::of(1.0, 0.04),
    Dimension::of(1.0, 0.06),
    // Plantarflexion of a relaxed foot and valgus of the heel: chosen.
    Dimension::of(5.0, 5.0),
    Dimension::of(3.0, 2.0),
    // Skin: 0.5 to 2.0 by site and sex (Krackowizer 2008).
    Dimension::of(1.4, 0.25),
];

use Sex::{Female, Male};

/// Phantoms P01 to P17: drawn once, evenly over the spreads above, and kept; four syndesmoses were changed so that overlap
/// and clear space are those published. P01 is about the average man.
#[rustfmt::skip]
pub(super) const FAMILY: [(Sex, Dimensions); 17] = [
    // P01
    (Male, [
        1.0, 18.0, 8.0, 21.8, 29.4, 6.0, 1.0, 24.0, 10.0,
        2.8, 2.5, 2.5, 15.3, 26.5, 2.7, 2.7, 4.8,
        -0.5, -4.5, -11.0, -19.5, 1.2, 3.6, 4.8,
        280.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.5,
    ]),
    // P02
    (Female, [
        0.893, 13.0, 8.5, 19.5, 23.5, 9.2, 0.82, 23.7, 11.1,
        2.27, 2.42, 1.87, 14.8, 24.7, 2.18, 2.54, 3.6,
        4.3, -1.8, -11.1, -19.4, 1.04, 3.0, 4.7,
        257.0, 51.0, 1.03, 1.01, 4.3, 0.1, 1.4,
    ]),
    // P03
    (Male, [
        1.026, 27.0, 12.3, 22.9, 29.3, 8.4, 0.97, 25.5, 9.8,
        3.55, 3.39, 3.21, 15.5, 31.8, 1.87, 3.72, 4.5,
        -0.6, -4.5, -14.8, -21.8, 1.14, 4.1, 5.2,
        234.0, 56.0, 1.04, 0.97, 5.7, 2.2, 1.3,
    ]),
    // P04
    (Female, [
        0.923, 18.5, 10.8, 19.7, 28.6, 7.0, 0.9, 24.5, 10.0,
        2.96, 2.21, 2.61, 14.4, 27.2, 2.14, 3.84, 3.2,
        3.7, -5.8, -8.9, -14.6, 0.95, 3.3, 4.2,
        221.0, 52.0, 1.02, 1.07, 3.6, 0.7, 1.4,
    ]),
    // P05
    (Male, [
        1.012, 15.0, 9.0, 24.0, 29.7, 6.6, 0.81, 21.7, 10.6,
        2.83, 2.16, 2.51, 15.4, 25.3, 2.1, 3.29, 2.5,
        3.4, -6.8, -12.3, -24.0, 1.26, 3.6, 5.1,
        297.0, 39.0, 0.99, 0.98, 7.8, 4.1, 1.5,
    ]),
    // P06
    (Female, [
        0.87, 10.0, 10.3, 18.3, 26.7, 6.8, 0.63, 22.5, 9.4,
        2.86, 2.53, 2.85, 14.7, 25.3, 1.7, 2.32, 4.4,
        1.8, -4.6, -11.5, -12.7, 1.04, 3.3, 3.7,
        251.0, 48.0, 0.94, 1.02, 1.3, 1.5, 1.5,
    ]),
    // P07
    (Male, [
        0.966, 21.0, 12.9, 22.0, 28.7, 5.6, 1.14, 24.0, 9.2,
        3.25, 2.16, 2.11, 15.8, 26.0, 2.49, 2.89, 3.5,
        -2.9, -3.8, -10.2, -22.2, 1.27, 3.4, 4.6,
        243.0, 41.0, 1.0, 1.06, 10.7, 3.3, 1.3,
    ]),
    // P08
    (Female, [
        0.833, 16.0, 5.1, 20.2, 22.9, 5.3, 0.91, 24.8, 8.6,
        2.56, 2.21, 2.43, 12.8, 22.1, 1.0, 3.34, 2.5,
        0.4, -3.5, -7.2, -15.5, 0.96, 2.6, 3.9,
        263.0, 44.0, 0.98, 1.0, 0.4, 3.8, 1.4,
    ]),
    // P09
    (Male, [
        1.053, 29.0, 11.3, 21.0, 34.2, 7.8, 1.12, 21.1, 10.2,
        3.93, 2.1, 2.54, 16.8, 33.5, 1.78, 4.4, 3.3,
        3.0, -4.9, -14.5, -18.3, 1.45, 3.8, 4.8,
        309.0, 34.0, 1.02, 1.04, -2.3, 3.5, 1.8,
    ]),
    // P10
    (Female, [
        0.931, 22.0, 9.9, 18.0, 27.1, 7.2, 0.61, 23.2, 10.4,
        2.45, 2.64, 2.57, 14.7, 26.4, 2.66, 3.61, 3.1,
        0.2, -2.7, -10.4, -15.6, 1.18, 2.8, 4.5,
        303.0, 45.0, 0.97, 0.98, 2.9, 4.8, 1.1,
    ]),
    // P11
    (Male, [
        0.958, 17.0, 6.1, 21.6, 29.0, 6.2, 0.83, 26.9, 7.8,
        2.74, 2.48, 1.89, 15.0, 26.1, 1.91, 2.66, 3.6,
        0.9, -3.6, -8.8, -21.4, 1.28, 3.2, 5.1,
        269.0, 36.0, 0.96, 1.09, 5.0, 3.0, 1.2,
    ]),
    // P12
    (Female, [
        0.953, 11.5, 8.0, 19.9, 28.6, 8.7, 0.96, 26.3, 8.3,
        2.59, 3.02, 2.49, 15.9, 23.1, 2.89, 2.08, 2.6,
        -0.2, -3.3, -10.4, -18.8, 1.17, 3.1, 4.9,
        339.0, 30.0, 0.95, 0.96, -0.7, 1.9, 1.6,
    ]),
    // P13
    (Male, [
        0.988, 23.0, 13.7, 20.3, 27.5, 7.6, 1.23, 23.5, 11.7,
        2.96, 2.5, 2.97, 16.3, 25.8, 1.19, 3.34, 2.8,
        2.4, -5.8, -10.2, -17.8, 1.08, 3.8, 4.7,
        317.0, 46.0, 1.01, 0.93, 12.3, 4.5, 1.7,
    ]),
    // P14
    (Female, [
        0.91, 20.0, 7.5, 18.4, 29.0, 4.8, 0.76, 22.9, 9.6,
        2.21, 2.52, 1.65, 14.5, 27.7, 2.94, 3.19, 3.8,
        1.1, -2.9, -9.1, -18.8, 1.11, 3.8, 4.5,
        326.0, 60.0, 1.06, 1.03, 7.1, 5.3, 1.5,
    ]),
    // P15
    (Male, [
        0.947, 19.5, 6.9, 20.4, 25.5, 8.1, 1.07, 22.2, 12.2,
        2.15, 2.2, 2.22, 16.3, 27.2, 1.46, 4.1, 2.5,
        -2.1, -2.4, -10.9, -19.1, 1.01, 3.8, 5.2,
        280.0, 42.0, 1.01, 0.94, 9.6, 2.5, 1.3,
    ]),
    // P16
    (Female, [
        0.899, 14.5, 9.5, 20.7, 25.9, 5.9, 0.69, 24.3, 11.4,
        2.82, 2.75, 2.04, 14.5, 25.2, 2.46, 3.58, 2.6,
        -1.4, -4.6, -7.2, -17.2, 1.16, 3.3, 4.0,
        291.0, 49.0, 0.99, 0.99, 2.2, 1.2, 1.0,
    ]),
    // P17
    (Male, [
        0.994, 25.0, 11.8, 21.9, 28.0, 7.4, 1.03, 25.8, 8.9,
        2.92, 2.96, 2.53, 16.1, 25.5, 2.69, 3.72, 2.2,
        -1.1, -5.5, -12.7, -24.4, 1.13, 3.4, 4.3,
        275.0, 54.0, 1.05, 0.91, 8.7, 5.9, 1.6,
    ]),
];
