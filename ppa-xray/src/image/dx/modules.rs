//! Modules of the Digital X-Ray image (PS3.3 A.26.3), except unique identifiers and pixels.

use dicom_dictionary_std::tags;
use nalgebra::Vector3;

use crate::beam::receptor::{AntiScatterGrid, DetectorModel};
use crate::image::dx::elements::Elements;
use crate::image::dx::{DxExposure, DxIntent, LOG_OF_ZERO, OPEN_STORED, STORED_PER_LOG};
use crate::image::exposure_index::deviation_index;
use crate::image::radiograph::{Engine, Radiograph};
use crate::matter::material::Material;

impl Radiograph {
    pub(super) fn put_modules(
        &self,
        to: &mut Elements,
        exposure: &DxExposure,
        intent: DxIntent,
        [columns, rows]: [u16; 2],
    ) {
        patient_study_series(to, exposure, intent);
        self.put_image(to, exposure, intent, [columns, rows]);
        self.put_detector(to, exposure);
        self.put_acquisition(to, exposure);
        self.put_field(to, [columns, rows]);
    }

    fn put_image(
        &self,
        to: &mut Elements,
        exposure: &DxExposure,
        intent: DxIntent,
        [columns, rows]: [u16; 2],
    ) {
        to.text(tags::IMAGE_TYPE, "DERIVED\\PRIMARY");
        to.text(tags::INSTANCE_NUMBER, "1");
        to.text(tags::BURNED_IN_ANNOTATION, "NO");
        to.text(tags::LOSSY_IMAGE_COMPRESSION, "00");
        to.text(tags::CONTENT_QUALIFICATION, "RESEARCH");
        to.text(
            tags::IMAGE_COMMENTS,
            "Synthetic: simulated from a voxel phantom. No exposure was made. Not for diagnosis.",
        );
        to.text(tags::PATIENT_ORIENTATION, &patient_orientation(exposure));
        let engine = match self.engine {
            Engine::Analog => "analog Monte Carlo",
            Engine::Fast => "ray-traced primary, Monte Carlo scatter and quantum noise",
        };
        let pixels = match intent {
            DxIntent::Processing => {
                format!("stored value = {OPEN_STORED} x signal / signal of the bare field")
            }
            DxIntent::Presentation(presentation) => format!(
                "stored value = {STORED_PER_LOG} x (t + {}), t = {} after multi-scale contrast enhancement",
                -LOG_OF_ZERO,
                match presentation.latitude_reduction {
                    0.0 => "ln(signal of the bare field / signal)".to_owned(),
                    r => format!("ln(1 + {r} x ln(signal of the bare field / signal)) / {r}"),
                }
            ),
        };
        let histories = self.histories;
        to.text(
            tags::DERIVATION_DESCRIPTION,
            &format!(
                "Synthetic radiograph: {engine}, {histories:e} photons, seed {}; {pixels}.",
                self.seed
            ),
        );

        to.short(tags::SAMPLES_PER_PIXEL, 1);
        to.short(tags::ROWS, rows);
        to.short(tags::COLUMNS, columns);
        to.short(tags::BITS_ALLOCATED, 16);
        to.short(tags::BITS_STORED, 16);
        to.short(tags::HIGH_BIT, 15);
        to.short(tags::PIXEL_REPRESENTATION, 0);
        to.text(tags::RESCALE_INTERCEPT, "0");
        to.text(tags::RESCALE_SLOPE, "1");
        to.text(tags::RESCALE_TYPE, "US");
        match intent {
            DxIntent::Processing => {
                // Little signal is bone, which readers expect to be white.
                to.text(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME1");
                to.text(tags::PRESENTATION_LUT_SHAPE, "INVERSE");
                to.text(tags::PIXEL_INTENSITY_RELATIONSHIP, "LIN");
                to.signed(tags::PIXEL_INTENSITY_RELATIONSHIP_SIGN, 1);
            }
            DxIntent::Presentation(presentation) => {
                to.text(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2");
                to.text(tags::PRESENTATION_LUT_SHAPE, "IDENTITY");
                to.text(tags::PIXEL_INTENSITY_RELATIONSHIP, "LOG");
                to.signed(tags::PIXEL_INTENSITY_RELATIONSHIP_SIGN, -1);
                // Starts at the bare field; lower stored values are equally black.
                let first = (-STORED_PER_LOG * LOG_OF_ZERO) as u16;
                let grey = presentation.grey();
                let shown = |stored: u16| {
                    let t = f64::from(stored) / STORED_PER_LOG + LOG_OF_ZERO;
                    (65_535.0 * grey(t)).round() as u16
                };
                let table = (first..=u16::MAX).map(shown).collect();
                to.voi_lut("Window", first, table);
            }
        }
    }

    fn put_detector(&self, to: &mut Elements, exposure: &DxExposure) {
        let receptor = &exposure.projection.receptor;
        let pixel_mm = self.detector.pixel_mm;
        match receptor.model {
            DetectorModel::Ideal => {
                to.empty(tags::DETECTOR_TYPE);
                to.text(
                    tags::DETECTOR_DESCRIPTION,
                    "Ideal: takes all energy of every photon",
                );
            }
            DetectorModel::Csi { thickness_um, .. } => {
                to.text(tags::DETECTOR_TYPE, "SCINTILLATOR");
                let description = format!("Caesium iodide, {thickness_um} um");
                to.text(tags::DETECTOR_DESCRIPTION, &description);
            }
            DetectorModel::Selenium { thickness_um } => {
                to.text(tags::DETECTOR_TYPE, "DIRECT");
                let description = format!("Amorphous selenium, {thickness_um} um");
                to.text(tags::DETECTOR_DESCRIPTION, &description);
            }
        }
        to.text(tags::DETECTOR_CONFIGURATION, "AREA");
        to.decimals(tags::IMAGER_PIXEL_SPACING, &[pixel_mm; 2]);
        to.decimals(tags::PIXEL_SPACING, &[pixel_mm; 2]);
        let [width_mm, height_mm] = self.detector.size_mm();
        to.text(tags::FIELD_OF_VIEW_SHAPE, "RECTANGLE");
        // Row dimension first: the length of a row.
        to.integers(tags::FIELD_OF_VIEW_DIMENSIONS, &[width_mm, height_mm]);
        match &receptor.grid {
            None => to.text(tags::GRID, "NONE"),
            Some(grid) => put_grid(to, grid),
        }
    }

    fn put_acquisition(&self, to: &mut Elements, exposure: &DxExposure) {
        let tube = exposure.tube;
        to.decimals(tags::KVP, &[tube.kvp]);
        to.text(tags::ANODE_TARGET_MATERIAL, "TUNGSTEN");
        let spot_mm = exposure.projection.source.focal_spot.size_mm;
        if spot_mm > 0.0 {
            to.decimals(tags::FOCAL_SPOTS, &[spot_mm]);
        }
        if let Some(mas) = self.mas().filter(|mas| mas.is_finite()) {
            to.integers(tags::EXPOSURE, &[mas]);
            to.integers(tags::EXPOSURE_INU_AS, &[1e3 * mas]);
        }
        // Distances are measured along the central ray (PS3.3 C.8.11.5), which need not be perpendicular to the detector.
        let source_detector_mm = self.source_detector_mm / exposure.projection.central_ray.z;
        to.decimals(tags::DISTANCE_SOURCE_TO_DETECTOR, &[source_detector_mm]);
        if let Some(source_patient_mm) = exposure.source_patient_mm {
            to.decimals(tags::DISTANCE_SOURCE_TO_PATIENT, &[source_patient_mm]);
            let magnification = source_detector_mm / source_patient_mm;
            to.decimals(
                tags::ESTIMATED_RADIOGRAPHIC_MAGNIFICATION_FACTOR,
                &[magnification],
            );
        }
        match tube.filters.len() {
            0 => return to.text(tags::FILTER_TYPE, "NONE"),
            // The terms for a single layer describe shapes that this one does not have.
            1 => {}
            _ => to.text(tags::FILTER_TYPE, "MULTIPLE"),
        }
        let materials: Vec<String> = tube
            .filters
            .iter()
            .map(|f| filter_term(&f.material))
            .collect();
        let thickness_mm: Vec<f64> = tube.filters.iter().map(|filter| filter.mm).collect();
        to.text(tags::FILTER_MATERIAL, &materials.join("\\"));
        to.decimals(tags::FILTER_THICKNESS_MINIMUM, &thickness_mm);
        to.decimals(tags::FILTER_THICKNESS_MAXIMUM, &thickness_mm);
    }

    /// Collimator and display shutter: edges are the first and last columns and rows outside the field, counted from 1.
    fn put_field(&self, to: &mut Elements, [columns, rows]: [u16; 2]) {
        let (columns, rows) = (usize::from(columns), usize::from(rows));
        let (mut low, mut high) = ([columns, rows], [0, 0]);
        for pixel in (0..columns * rows).filter(|&pixel| self.in_field(pixel)) {
            for (axis, at) in [pixel % columns, pixel / columns].into_iter().enumerate() {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at + 1);
            }
        }
        let edges = [low[0], high[0] + 1, low[1], high[1] + 1].map(|edge| edge as f64);
        to.text(tags::COLLIMATOR_SHAPE, "RECTANGULAR");
        to.text(tags::SHUTTER_SHAPE, "RECTANGULAR");
        to.short(tags::SHUTTER_PRESENTATION_VALUE, 0);
        for (edge, [collimator, shutter]) in edges.into_iter().zip([
            [
                tags::COLLIMATOR_LEFT_VERTICAL_EDGE,
                tags::SHUTTER_LEFT_VERTICAL_EDGE,
            ],
            [
                tags::COLLIMATOR_RIGHT_VERTICAL_EDGE,
                tags::SHUTTER_RIGHT_VERTICAL_EDGE,
            ],
            [
                tags::COLLIMATOR_UPPER_HORIZONTAL_EDGE,
                tags::SHUTTER_UPPER_HORIZONTAL_EDGE,
            ],
            [
                tags::COLLIMATOR_LOWER_HORIZONTAL_EDGE,
                tags::SHUTTER_LOWER_HORIZONTAL_EDGE,
            ],
        ]) {
            to.integers(collimator, &[edge]);
            to.integers(shutter, &[edge]);
        }
    }
}

/// Exposure index, and with a target the deviation index of IEC 62494-1; nothing for an image without an index.
pub(super) fn put_exposure_index(to: &mut Elements, index: Option<f64>, target: Option<f64>) {
    let Some(index) = index else {
        return;
    };
    to.decimals(tags::EXPOSURE_INDEX, &[index]);
    if let Some(target) = target {
        to.decimals(tags::TARGET_EXPOSURE_INDEX, &[target]);
        to.decimals(tags::DEVIATION_INDEX, &[deviation_index(index, target)]);
    }
}

fn patient_study_series(to: &mut Elements, exposure: &DxExposure, intent: DxIntent) {
    to.text(tags::SOP_CLASS_UID, intent.sop_class());
    for unknown in [
        tags::PATIENT_NAME,
        tags::PATIENT_ID,
        tags::PATIENT_BIRTH_DATE,
        tags::PATIENT_SEX,
        tags::STUDY_DATE,
        tags::STUDY_TIME,
        tags::REFERRING_PHYSICIAN_NAME,
        tags::STUDY_ID,
        tags::ACCESSION_NUMBER,
    ] {
        to.empty(unknown);
    }
    to.text(tags::PATIENT_IDENTITY_REMOVED, "YES");
    to.text(
        tags::DEIDENTIFICATION_METHOD,
        "Simulated image, nothing copied from a patient's header",
    );
    to.text(tags::MODALITY, "DX");
    to.text(tags::SERIES_NUMBER, "1");
    to.text(
        tags::PRESENTATION_INTENT_TYPE,
        match intent {
            DxIntent::Processing => "FOR PROCESSING",
            DxIntent::Presentation(_) => "FOR PRESENTATION",
        },
    );
    to.text(tags::MANUFACTURER, "ppa-xray");
    to.text(tags::MANUFACTURER_MODEL_NAME, "Simulated x-ray device");
    to.text(tags::SOFTWARE_VERSIONS, env!("CARGO_PKG_VERSION"));
    let examination = &exposure.examination;
    to.text(tags::BODY_PART_EXAMINED, examination.region.body_part());
    to.text(tags::IMAGE_LATERALITY, examination.side.letter());
    to.code(tags::ANATOMIC_REGION_SEQUENCE, examination.region.code());
    to.code(tags::VIEW_CODE_SEQUENCE, examination.view.code());
    to.text(tags::POSITIONER_TYPE, "NONE");
    to.no_items(tags::ACQUISITION_CONTEXT_SEQUENCE);
}

fn put_grid(to: &mut Elements, grid: &AntiScatterGrid) {
    let kind = if grid.focus_mm.is_some() {
        "FOCUSED"
    } else {
        "PARALLEL"
    };
    let motion = if grid.moving {
        "RECIPROCATING"
    } else {
        "FIXED"
    };
    to.text(tags::GRID, &format!("{motion}\\{kind}"));
    let pitch_mm = 10.0 / grid.lines_per_cm;
    to.text(tags::GRID_ABSORBING_MATERIAL, &grid.strip);
    to.text(tags::GRID_SPACING_MATERIAL, &grid.interspace);
    to.decimals(
        tags::GRID_THICKNESS,
        &[grid.ratio * (pitch_mm - grid.strip_mm)],
    );
    to.decimals(tags::GRID_PITCH, &[pitch_mm]);
    to.text(tags::GRID_ASPECT_RATIO, &format!("{:.0}\\1", grid.ratio));
    if let Some(focus_mm) = grid.focus_mm {
        to.decimals(tags::GRID_FOCAL_DISTANCE, &[focus_mm]);
    }
}

/// Defined term or name of a filter's material, at most 16 characters.
fn filter_term(material: &Material) -> String {
    let [(z, _)] = material.mass_fractions() else {
        return code_string(material.name());
    };
    match z {
        13 => "ALUMINUM".to_owned(),
        29 => "COPPER".to_owned(),
        41 => "NIOBIUM".to_owned(),
        42 => "MOLYBDENUM".to_owned(),
        45 => "RHODIUM".to_owned(),
        63 => "EUROPIUM".to_owned(),
        82 => "LEAD".to_owned(),
        _ => code_string(material.name()),
    }
}

/// Converts a name to the characters of a code string: upper case, digits, spaces and underscores.
fn code_string(name: &str) -> String {
    let allowed = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    };
    name.chars().take(16).map(allowed).collect()
}

/// Directions of rows and columns in the patient: letters of the axes of the ct frame, the strongest first.
fn patient_orientation(exposure: &DxExposure) -> String {
    let ct_from_device = &exposure.projection.ct_from_device;
    let letters = |device: Vector3<f64>| {
        let ct = ct_from_device.rotation * device;
        let mut axes = [("L", "R", ct.x), ("P", "A", ct.y), ("H", "F", ct.z)];
        axes.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        axes.iter()
            .filter(|(_, _, share)| share.abs() > 0.25)
            .map(|(positive, negative, share)| if *share > 0.0 { *positive } else { *negative })
            .collect::<String>()
    };
    format!("{}\\{}", letters(Vector3::x()), letters(Vector3::y()))
}
