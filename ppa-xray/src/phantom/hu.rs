//! Conversion of Hounsfield units to material and mass density, by a table per scanner.

use serde::{Deserialize, Serialize};

use crate::phantom::built_in_calibration;
use crate::phantom::calibration_error::CalibrationError;
use crate::phantom::segment::Segment;

/// A table that converts HU to material and density, after Schneider, Bortfeld and Schlegel, Phys. Med. Biol. 45 (2000) 459.
///
/// The Hounsfield scale is divided into segments. Each has one material, or a gradual mixture of two, and a
/// density curve, so the density is continuous within a segment. The relation between HU and density depends on
/// scanner, tube voltage and kernel: a table can be read from a TOML file (`HuCalibration::read`, feature `files`); the default is
/// `data/hu_calibration.toml` of this crate.
///
/// ```
/// # use ppa_xray::HuCalibration;
/// let table = r#"
///     [[segment]]
///     name = "air"
///     material = "air"
///     density = [[-1000, 0.001205]]         # knots [HU, g/cm³]; a single one is a constant
///
///     [[segment]]
///     name = "soft tissue and bone"
///     from_hu = -800
///     mixture = [                           # pure below and above these densities, mixed by volume in between
///         { material = "muscle", density_g_cm3 = 1.06 },
///         { material = "bone_cortical", density_g_cm3 = 1.85 },
///     ]
///     density = [[-1000, 0.001205], [60, 1.06], [1524, 1.92]]
///
///     [[segment]]
///     name = "nail"
///     from_hu = 2500
///     material = "Co:0.65,Cr:0.28,Mo:0.07"  # a name of the library or mass fractions
///     density = [[2500, 8.3]]
/// "#;
/// let calibration = HuCalibration::parse(table)?;
/// assert_eq!(calibration.segment(3000.0).name, "nail");
/// assert!((calibration.density_g_cm3(60.0) - 1.06).abs() < 1e-6);
/// # Ok::<(), ppa_xray::CalibrationError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HuCalibration {
    /// The segments, from low to high HU.
    #[serde(rename = "segment")]
    pub segments: Vec<Segment>,
}

impl Default for HuCalibration {
    fn default() -> Self {
        Self {
            segments: built_in_calibration::segments(),
        }
    }
}

impl HuCalibration {
    /// Reads a table from a TOML file.
    ///
    /// # Errors
    /// [`CalibrationError`] naming the file, and the line or the segment that is invalid.
    #[cfg(feature = "files")]
    pub fn read(path: &std::path::Path) -> Result<Self, CalibrationError> {
        let in_file = |source| CalibrationError::File {
            path: path.into(),
            source: Box::new(source),
        };
        ppa_core::regular_file::read_to_string(path)
            .map_err(CalibrationError::Read)
            .and_then(|text| Self::parse(&text))
            .map_err(in_file)
    }

    /// Reads a table from the text of a TOML file.
    ///
    /// # Errors
    /// [`CalibrationError`] naming the line or the segment that is invalid.
    #[cfg(feature = "files")]
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let table: Self = toml::from_str(text).map_err(|error| CalibrationError::Syntax {
            line: error
                .span()
                .map_or(1, |span| 1 + text[..span.start].matches('\n').count()),
            message: error.message().to_owned(),
        })?;
        table.validate()?;
        Ok(table)
    }

    /// Checks that segments and knots rise, that no density falls and that every material exists.
    ///
    /// # Errors
    /// [`CalibrationError`] naming the invalid segment.
    pub fn validate(&self) -> Result<(), CalibrationError> {
        if self.segments.is_empty() {
            return Err(CalibrationError::Empty);
        }
        let mut lowest = f32::NEG_INFINITY;
        for (index, segment) in self.segments.iter().enumerate() {
            match segment.from_hu {
                None if index == 0 => {}
                Some(from) if from.is_finite() && from > lowest => lowest = from,
                found => {
                    return Err(CalibrationError::Start {
                        segment: segment.name.clone(),
                        found,
                        previous: lowest,
                    });
                }
            }
            segment.validate()?;
        }
        Ok(())
    }

    /// The segment of a Hounsfield value; values below the first segment belong to it as well.
    pub fn segment(&self, hu: f32) -> &Segment {
        &self.segments[self.segment_index(hu)]
    }

    pub(crate) fn segment_index(&self, hu: f32) -> usize {
        self.segments[1..].partition_point(|segment| segment.from_hu.is_some_and(|from| from <= hu))
    }

    /// Mass density in g/cm³ of a Hounsfield value.
    pub fn density_g_cm3(&self, hu: f32) -> f32 {
        self.segment(hu).density_g_cm3(hu)
    }
}

#[cfg(all(test, feature = "files"))]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const BUILT_IN: &str = include_str!("../../data/hu_calibration.toml");

    #[test]
    fn landmarks_of_the_scale_get_their_density_and_segment() {
        let calibration = HuCalibration::default();
        // Water 1.0, adipose 0.95, muscle 1.05 and dense cortical bone 1.92 g/cm³ (ICRU 44).
        for (hu, density, within, name) in [
            (-70.0, 0.95, 0.01, "fat to muscle"),
            (0.0, 1.0, 0.02, "fat to muscle"),
            (50.0, 1.05, 0.01, "muscle"),
            (1_524.0, 1.92, 0.01, "bone"),
            (-1_000.0, 0.001_2, 1e-4, "air"),
            (8_000.0, 4.54, 1e-4, "metal"),
        ] {
            let found = calibration.density_g_cm3(hu);
            assert!((found - density).abs() < within, "{hu} HU: {found}");
            assert_eq!(calibration.segment(hu).name, name);
        }
    }

    proptest! {
        #[test]
        fn segment_and_density_never_fall_as_hu_rises(a in -1_100.0..9_000.0_f32, step in 0.0..500.0_f32) {
            let calibration = HuCalibration::default();
            prop_assert!(calibration.segment_index(a) <= calibration.segment_index(a + step));
            prop_assert!(calibration.density_g_cm3(a) <= calibration.density_g_cm3(a + step));
        }

        /// The steepest branch of the default curve is 1.03e-3 g/cm³ per HU.
        #[test]
        fn density_is_continuous_from_skin_to_bone(a in -799.0..2_798.0_f32) {
            let calibration = HuCalibration::default();
            let jump = calibration.density_g_cm3(a + 1.0) - calibration.density_g_cm3(a);
            prop_assert!(jump < 1.1e-3, "{jump}");
        }
    }

    #[test]
    fn the_example_file_is_the_built_in_table() {
        let calibration = HuCalibration::parse(BUILT_IN).unwrap();
        assert_eq!(calibration, HuCalibration::default());
    }

    #[test]
    fn a_table_survives_its_file() {
        let calibration = HuCalibration::default();
        let text = toml::to_string(&calibration).unwrap();
        assert_eq!(HuCalibration::parse(&text).unwrap(), calibration);
    }

    /// Every kind of mistake is reported with its segment or line.
    #[test]
    fn mistakes_are_reported_with_their_place() {
        let broken = |from: &str, to: &str| {
            assert!(BUILT_IN.contains(from), "{from}");
            let error = HuCalibration::parse(&BUILT_IN.replacen(from, to, 1)).unwrap_err();
            let source = std::error::Error::source(&error).map(ToString::to_string);
            format!("{error} {}", source.unwrap_or_default())
        };
        for (from, to, report) in [
            (
                "[14, 1.0305], [100, 1.0762]]",
                "[14, 1.0305], [14, 1.0762]]",
                "segment \"muscle\": knot 2",
            ),
            (
                "from_hu = 100",
                "from_hu = 10",
                "segment \"bone\" begins at 10 HU",
            ),
            (
                "from_hu = 100",
                "from_hu = nan",
                "segment \"bone\" begins at NaN HU",
            ),
            ("from_hu = 100", "", "segment \"bone\" has no `from_hu`"),
            (
                "density = [[2800, 4.54]]",
                "density = []",
                "segment \"metal\" has no density",
            ),
            (
                "[[2800, 4.54]]",
                "[[2800, -4.54]]",
                "segment \"metal\": knot 1",
            ),
            (
                "\"titanium\"",
                "\"unobtainium\"",
                "segment \"metal\" no material is named",
            ),
            (
                "\"titanium\"",
                "\"Ti:0.5\"",
                "segment \"metal\" the mass fractions",
            ),
            (
                "density_g_cm3 = 1.85",
                "density_g_cm3 = 1.05",
                "segment \"bone\" mixes",
            ),
            (
                "from_hu = 100",
                "from_hu = 100\nhu = 3",
                "line 42: unknown field `hu`",
            ),
            (
                "material = \"titanium\"",
                "",
                "needs either `material` or `mixture`",
            ),
        ] {
            let message = broken(from, to);
            assert!(message.contains(report), "{to:?}: {message}");
        }
        assert!(matches!(
            HuCalibration::parse("segment = []"),
            Err(CalibrationError::Empty)
        ));
    }
}
