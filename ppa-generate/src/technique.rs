//! Radiographic techniques: tube, field and detector of an examination, as rooms use them.

use ppa_xray::{
    Blur, Collimation, Detector, DetectorModel, FocalSpot, HeelEffect, Receptor, Source, TubeLoad,
};

use crate::plan::{MarkerPlace, XraySettings};

/// An examination with usual exposure factors.
///
/// Tube voltage and load are in the middle of the ranges that Radiopaedia states for adults (articles "Ankle (mortise view)": 50 to 60 kVp, 3 to 5
/// mAs; "Knee (AP view)": 60 to 70 kVp, 7 to 10 mAs; both at 100 cm and without a grid). Filtration is the least that IEC 60601-1-3
/// allows. The letter of the side lies in the upper corner beside the fibula. The detector is 0.6 mm of caesium iodide with pixels of 0.148 mm, as flat panels of 43 cm have them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Technique {
    /// Ankle and hindfoot, without a grid.
    Ankle,
    /// Knee, without a grid.
    Knee,
}

impl Technique {
    /// All of them, with their names.
    pub const ALL: [(&'static str, Self); 2] = [("ankle", Self::Ankle), ("knee", Self::Knee)];

    /// Sets tube, field, detector and tube load of the examination; materials, voxels, engine and presentation stay.
    pub fn apply(self, settings: &mut XraySettings) {
        let (kvp, mas) = match self {
            Self::Ankle => (55.0, 4.0),
            Self::Knee => (65.0, 8.5),
        };
        *settings = XraySettings {
            kvp,
            anode_angle_deg: 12.0,
            filters: vec!["Al:2.5".to_owned()],
            source: Source::default()
                .with_focal_spot(FocalSpot::default().with_size_mm(0.6))
                .with_collimation(Collimation::Rectangle {
                    size_mm: [180.0, 220.0],
                    centre_mm: [0.0; 2],
                })
                .with_blades_mm(Some(250.0))
                // The head's side.
                .with_heel_effect(Some(HeelEffect::new(-90.0))),
            detector: Detector::centred(1_504, 1_504, 0.148),
            receptor: Receptor::default()
                .with_model(DetectorModel::Csi {
                    thickness_um: 600.0,
                    packing: 0.8,
                })
                .with_collection_swank(0.92)
                .with_blur(Some(Blur::lorentzian(0.45)))
                .with_electronic_noise_kev(90.0),
            marker: Some(MarkerPlace::new([-75.0, -95.0])),
            tube_load: Some(TubeLoad::Mas(mas)),
            analog: None,
            ..settings.clone()
        };
    }
}
