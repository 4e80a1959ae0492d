//! Radiographic techniques: tube, field and detector of an examination, as rooms use them.

use ppa_xray::{
    Blur, Collimation, Detector, DetectorModel, FocalSpot, HeelEffect, Receptor, Source, TubeLoad,
};

use crate::plan::{MarkerPlace, XraySettings};

/// An examination with usual exposure factors.
///
/// Tube voltage and load are in the middle of the ranges that Radiopaedia states for adults, all at 100 cm and without a grid:
///
/// | technique | article | kVp | mAs |
/// |---|---|---|---|
/// | ankle | Ankle (mortise view) | 50 to 60 | 3 to 5 |
/// | knee | Knee (AP view) | 60 to 70 | 7 to 10 |
/// | lower leg | Tibia fibula (AP view) | 50 to 60 | 3 to 5 |
/// | foot | Foot (dorsoplantar view) | 50 to 55 | 3 to 4 |
/// | hand | Hand (PA view) | 50 to 60 | 1 to 5 |
/// | wrist | Wrist (PA view) | 50 to 60 | 3 to 5 |
/// | elbow | Elbow (AP view) | 50 to 60 | 2 to 5 |
///
/// Filtration is the least that IEC 60601-1-3 allows. The field is 180 mm wide and along the limb as long as the detectors named there, 220
/// mm for ankle and knee. The side marker is in its upper corner, next to the fibula of a leg. The detector is 0.6 mm of caesium iodide
/// with pixels of 0.148 mm, as flat panels of 43 cm have them, without the rows outside the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Technique {
    /// Ankle and hindfoot.
    Ankle,
    /// Knee.
    Knee,
    /// Tibia and fibula from knee to ankle.
    LowerLeg,
    /// Foot from heel to toes.
    Foot,
    /// Hand and wrist.
    Hand,
    /// Wrist with half of the metacarpals.
    Wrist,
    /// Elbow.
    Elbow,
}

/// What differs between the examinations.
struct Factors {
    kvp: f64,
    mas: f64,
    /// Length of the field along the limb.
    field_length_mm: f64,
}

/// Width and height of pixels, mm.
const PIXEL_MM: f64 = 0.148;

/// Rows that hold a field of a length in mm, a multiple of 32.
fn rows(length_mm: f64) -> u32 {
    (length_mm / PIXEL_MM / 32.0).ceil() as u32 * 32
}

impl Technique {
    /// All techniques, with their names.
    pub const ALL: [(&'static str, Self); 7] = [
        ("ankle", Self::Ankle),
        ("knee", Self::Knee),
        ("lower-leg", Self::LowerLeg),
        ("foot", Self::Foot),
        ("hand", Self::Hand),
        ("wrist", Self::Wrist),
        ("elbow", Self::Elbow),
    ];

    fn factors(self) -> Factors {
        let (kvp, mas, field_length_mm) = match self {
            Self::Ankle => (55.0, 4.0, 220.0),
            Self::Knee => (65.0, 8.5, 220.0),
            Self::LowerLeg => (55.0, 4.0, 420.0),
            Self::Foot => (52.5, 3.5, 240.0),
            Self::Hand => (55.0, 3.0, 240.0),
            Self::Wrist => (55.0, 4.0, 240.0),
            Self::Elbow => (55.0, 3.5, 240.0),
        };
        Factors {
            kvp,
            mas,
            field_length_mm,
        }
    }

    /// Sets tube, field, detector and tube load of the examination; materials, voxels, engine and presentation stay.
    pub fn apply(self, settings: &mut XraySettings) {
        let Factors {
            kvp,
            mas,
            field_length_mm: length_mm,
        } = self.factors();
        let width_mm = 180.0;
        *settings = XraySettings {
            kvp,
            anode_angle_deg: 12.0,
            filters: vec!["Al:2.5".to_owned()],
            source: Source::default()
                .with_focal_spot(FocalSpot::default().with_size_mm(0.6))
                .with_collimation(Collimation::Rectangle {
                    size_mm: [width_mm, length_mm],
                    centre_mm: [0.0; 2],
                })
                .with_blades_mm(Some(250.0))
                // The head's side.
                .with_heel_effect(Some(HeelEffect::new(-90.0))),
            detector: Detector::centred(1_504, rows(length_mm), PIXEL_MM),
            receptor: Receptor::default()
                .with_model(DetectorModel::Csi {
                    thickness_um: 600.0,
                    packing: 0.8,
                })
                .with_collection_swank(0.92)
                .with_blur(Some(Blur::lorentzian(0.45)))
                .with_electronic_noise_kev(90.0),
            marker: Some(MarkerPlace::new([
                15.0 - width_mm / 2.0,
                15.0 - length_mm / 2.0,
            ])),
            tube_load: Some(TubeLoad::Mas(mas)),
            analog: None,
            ..settings.clone()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_and_letters_are_on_the_detector() {
        for (name, technique) in Technique::ALL {
            let mut settings = XraySettings::default();
            technique.apply(&mut settings);
            let detector = settings.detector;
            let Collimation::Rectangle { size_mm: field, .. } = settings.source.collimation else {
                panic!("{name}");
            };
            let [width, length] =
                [detector.columns, detector.rows].map(|pixels| f64::from(pixels) * PIXEL_MM);
            assert!(field[0] < width && field[1] < length, "{name}");
            // By less than the 32 rows of a step.
            assert!(length - field[1] < 32.0 * PIXEL_MM, "{name}");
            let letter = settings.marker.unwrap();
            for axis in [0, 1] {
                let to_edge = field[axis] / 2.0 - letter.centre_mm[axis].abs();
                assert!(to_edge > letter.height_mm / 2.0, "{name}");
            }
        }
    }
}
