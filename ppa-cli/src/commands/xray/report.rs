//! Report of `simulate` and `merge` on a radiograph and its doses.

use std::collections::BTreeMap;
use std::path::Path;

use ppa_xray::{Category, CategorySums, Dose, Engine, Radiograph, deviation_index};
use serde::Serialize;

use crate::output::Seconds;

/// One simulated exposure.
#[derive(Debug, Serialize)]
pub struct Report {
    projections: [Projected; 1],
    histories: f64,
    engine: Engine,
    #[serde(flatten)]
    exposure: ExposureReport,
    #[serde(flatten)]
    entrance: EntranceReport,
    #[serde(flatten)]
    dose: Option<DoseReport>,
    #[serde(flatten)]
    seconds: Seconds,
}

/// Energy on the detector.
#[derive(Debug, Serialize)]
struct Projected {
    #[serde(flatten)]
    sums: CategorySums,
    /// Photons into the field per mAs; null if the fluence of the spectrum is unknown, as are the fields below.
    histories_per_mas: Option<f64>,
    /// Tube load that corresponds to the quantum noise of the image.
    mas: Option<f64>,
    ev_per_mas: Option<BTreeMap<&'static str, f64>>,
    open_field_ev_cm2_per_mas: Option<f64>,
}

/// Indices of IEC 62494-1; null if unknown.
#[derive(Debug, Default, Serialize)]
struct ExposureReport {
    exposure_index: Option<f64>,
    target_exposure_index: Option<f64>,
    deviation_index: Option<f64>,
}

/// Doses of the materials, all in the same order.
#[derive(Debug, Serialize)]
struct DoseReport {
    materials: Vec<String>,
    material_mass_g: Vec<f64>,
    material_dose_ev_per_history: Vec<f64>,
    material_dose_ev_per_history_se: Vec<f64>,
    material_dose_gy_per_history: Vec<f64>,
    detector_air_kerma_gy_per_history: f64,
    detector_air_kerma_gy_per_history_se: f64,
    detector_air_kerma_ugy_per_mas: Option<f64>,
}

/// Incident air kerma at the skin; null if the central ray misses the patient or it is unknown.
#[derive(Debug, Default, Serialize)]
struct EntranceReport {
    entrance_air_kerma_gy_per_history: Option<f64>,
    entrance_air_kerma_ugy_per_mas: Option<f64>,
    /// For the tube load that corresponds to the quantum noise of the image.
    entrance_air_kerma_ugy: Option<f64>,
}

impl EntranceReport {
    fn new(radiograph: &Radiograph, gy_per_history: Option<f64>) -> Self {
        let ugy = |histories: f64| gy_per_history.map(|gray| 1e6 * gray * histories);
        Self {
            entrance_air_kerma_gy_per_history: gy_per_history,
            entrance_air_kerma_ugy_per_mas: radiograph.histories_per_mas.and_then(ugy),
            entrance_air_kerma_ugy: ugy(radiograph.histories).filter(|ugy| ugy.is_finite()),
        }
    }
}

impl Report {
    pub fn new(radiograph: &Radiograph, dose: Option<&Dose>, seconds: Seconds) -> Self {
        let sums = radiograph.sums;
        let per_mas = radiograph.histories_per_mas;
        let projected = Projected {
            sums,
            histories_per_mas: per_mas,
            mas: radiograph.mas(),
            ev_per_mas: per_mas.map(|factor| {
                let of = |category: Category| (category.name(), sums.of(category).0 * factor);
                Category::ALL.map(of).into()
            }),
            open_field_ev_cm2_per_mas: per_mas.map(|factor| radiograph.open_field_ev_cm2 * factor),
        };
        Self {
            projections: [projected],
            histories: radiograph.histories,
            engine: radiograph.engine,
            exposure: ExposureReport::default(),
            entrance: EntranceReport::new(
                radiograph,
                dose.and_then(|dose| dose.entrance_air_kerma_gy_per_history),
            ),
            dose: dose.map(DoseReport::new),
            seconds,
        }
    }

    /// Adds the incident air kerma at the skin.
    pub fn with_entrance_kerma(self, radiograph: &Radiograph, gy_per_history: Option<f64>) -> Self {
        Self {
            entrance: EntranceReport::new(radiograph, gy_per_history),
            ..self
        }
    }

    /// Adds an exposure index and its deviation from a target.
    pub fn with_exposure_index(mut self, index: Option<f64>, target: Option<f64>) -> Self {
        self.exposure = ExposureReport {
            exposure_index: index,
            target_exposure_index: target,
            deviation_index: index
                .zip(target)
                .map(|(index, target)| deviation_index(index, target)),
        };
        self
    }

    /// Describes the report; `written` are the output files.
    pub fn describe(&self, written: &[&Path]) -> String {
        let projected = &self.projections[0];
        let mut text = "eV per history on the detector\n".to_owned();
        for category in Category::ALL {
            let (value, se) = projected.sums.of(category);
            text += &format!("{:<10}{value:>12.3} ± {se:.3}\n", category.name());
        }
        if let Some(dose) = &self.dose {
            text += "eV per history imparted to the phantom\n";
            let values = dose.material_dose_ev_per_history.iter();
            let values = values.zip(&dose.material_dose_ev_per_history_se);
            for (name, (value, se)) in dose.materials.iter().zip(values) {
                text += &format!("{name:<24}{value:>12.3} ± {se:.3}\n");
            }
            if let Some(kerma) = dose.detector_air_kerma_ugy_per_mas {
                text += &format!("air kerma at the detector {kerma:.4e} µGy/mAs\n");
            }
        }
        if let Some(per_mas) = self.entrance.entrance_air_kerma_ugy_per_mas {
            text += &format!("air kerma at the skin {per_mas:.4e} µGy/mAs");
            if let Some(ugy) = self.entrance.entrance_air_kerma_ugy {
                text += &format!(", {ugy:.4e} µGy");
            }
            text.push('\n');
        }
        if let Some(index) = self.exposure.exposure_index {
            text += &format!("exposure index {index:.3}");
            if let Some(deviation) = self.exposure.deviation_index {
                text += &format!(", deviation {deviation:+.1}");
            }
            text.push('\n');
        }
        text += &format!("{:.3e} histories", self.histories);
        if let Some(mas) = projected.mas.filter(|mas| mas.is_finite()) {
            text += &format!(" ({mas:.3e} mAs)");
        }
        text += &format!(
            ", {:.1} s, {:.1} CPU s",
            self.seconds.wall_s, self.seconds.cpu_s
        );
        for path in written {
            text += &format!("; {}", path.display());
        }
        text
    }
}

impl DoseReport {
    fn new(dose: &Dose) -> Self {
        let imparted = || dose.materials.iter().map(|(_, imparted)| imparted);
        let per_mas = |gray: f64| Some(1e6 * gray * dose.histories_per_mas?);
        let detector = dose.detector_air_kerma_gy_per_history;
        Self {
            materials: dose
                .materials
                .iter()
                .map(|(name, _)| name.clone())
                .collect(),
            material_mass_g: imparted().map(|matter| matter.mass_g).collect(),
            material_dose_ev_per_history: imparted().map(|m| m.ev_per_history.value).collect(),
            material_dose_ev_per_history_se: imparted().map(|m| m.ev_per_history.se).collect(),
            material_dose_gy_per_history: imparted().map(|m| m.gy_per_history().value).collect(),
            detector_air_kerma_gy_per_history: detector.value,
            detector_air_kerma_gy_per_history_se: detector.se,
            detector_air_kerma_ugy_per_mas: per_mas(detector.value),
        }
    }
}
