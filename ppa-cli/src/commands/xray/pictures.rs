//! Presentation of a radiograph, and its DICOM image.

use std::path::PathBuf;

use clap::Args;
use ppa_generate::{Case, PosedExposure, XraySettings, tube};
use ppa_scene::{LimbKind, Side};
use ppa_xray::{
    DxExposure, DxIntent, Examination, Laterality, Presentation, Radiograph, Region, TubeLoad, View,
};

use crate::output_files::OutputFiles;

#[derive(Debug, Args)]
pub struct PictureArgs {
    /// Fixed window and contrast by name, in place of the plan's: limb, ankle_ap, ankle_mortise or ankle_lateral
    #[arg(long, value_name = "NAME", value_parser = protocol)]
    protocol: Option<Presentation>,
    /// Fit the window to this image alone; images to be compared or trained on need a fixed window
    #[arg(long)]
    autoscale: bool,
    /// Radiograph to write: DICOM Digital X-Ray image, flagged as synthetic
    #[arg(long, value_name = "FILE")]
    pub dicom: Option<PathBuf>,
    /// Write the DICOM image For Processing: detector signal instead of the presentation
    #[arg(long, requires = "dicom")]
    for_processing: bool,
    /// Target exposure index of the examination, for the deviation index of IEC 62494-1; no standard specifies one
    #[arg(long, value_name = "EI", value_parser = target_exposure_index)]
    target_exposure_index: Option<f64>,
}

fn target_exposure_index(text: &str) -> Result<f64, String> {
    let index = text.parse().ok();
    let valid = index.filter(|index| (1.0..=1e6).contains(index));
    valid.ok_or_else(|| "expected a number from 1 to 1e6".to_owned())
}

fn protocol(name: &str) -> Result<Presentation, String> {
    Presentation::protocol(name).map_err(|error| error.to_string())
}

/// Medial rotation from which a frontal view is called oblique, and from which it is called lateral, degrees.
const OBLIQUE_FROM_DEG: f64 = 7.5;
const LATERAL_FROM_DEG: f64 = 67.5;

impl PictureArgs {
    pub fn presentation(
        &self,
        settings: &XraySettings,
        radiograph: &Radiograph,
    ) -> anyhow::Result<Presentation> {
        let fixed = self.protocol.unwrap_or(settings.presentation);
        Ok(if self.autoscale {
            fixed.fitted(radiograph)?
        } else {
            fixed
        })
    }

    /// The target exposure index: the one given, or that of automatic exposure control.
    pub fn target_exposure_index(&self, settings: &XraySettings) -> Option<f64> {
        let controlled = match settings.tube_load {
            Some(TubeLoad::ExposureIndex(index)) => Some(index),
            _ => None,
        };
        self.target_exposure_index.or(controlled)
    }

    /// Declares the DICOM image.
    pub fn declare(&self, outputs: &mut OutputFiles) -> anyhow::Result<()> {
        let Some(path) = &self.dicom else {
            return Ok(());
        };
        // DICOM files often have no extension.
        let endings: &[&str] = match path.extension() {
            Some(_) => &[".dcm", ".dicom"],
            None => &[],
        };
        outputs.file("--dicom", path, endings)
    }

    /// Writes the DICOM image if one was asked for; `angle_deg` is the medial rotation of the limb.
    pub fn write_dicom(
        &self,
        radiograph: &Radiograph,
        presentation: Presentation,
        exposure: &PosedExposure,
        case: &Case,
        angle_deg: f64,
    ) -> anyhow::Result<()> {
        let Some(path) = &self.dicom else {
            return Ok(());
        };
        let intent = if self.for_processing {
            DxIntent::Processing
        } else {
            DxIntent::Presentation(presentation)
        };
        let limb = &exposure.limb;
        let tube = tube(limb.settings())?;
        let examination = examination(case, limb.prepared.landmarks.limb, angle_deg);
        let study = &case.source.volume_sha256;
        let exposure = DxExposure::new(&exposure.projection, &tube, examination, study)
            .with_source_patient_mm(Some(limb.table.source_table_mm()))
            .with_target_exposure_index(self.target_exposure_index(limb.settings()));
        Ok(radiograph.write_dicom(path, &exposure, intent)?)
    }
}

/// The beam comes from above: from the front at rest, and from the side that medial rotation turns upwards.
fn examination(case: &Case, limb: LimbKind, angle_deg: f64) -> Examination {
    let view = match angle_deg {
        angle if angle >= LATERAL_FROM_DEG => View::LateroMedial,
        angle if angle <= -LATERAL_FROM_DEG => View::MedioLateral,
        angle if angle.abs() >= OBLIQUE_FROM_DEG => View::AnteroPosteriorOblique,
        _ => View::AnteroPosterior,
    };
    Examination {
        region: match limb {
            LimbKind::LowerLeg => Region::Ankle,
            LimbKind::Knee => Region::Knee,
            LimbKind::Other => Region::Extremity,
        },
        side: match case.side {
            Side::Left => Laterality::Left,
            Side::Right => Laterality::Right,
        },
        view,
    }
}
