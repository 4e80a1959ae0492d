//! Import audit: geometry, values and content of a scan, and their consequences for the images made from it.
//!
//! [`Audit::of`] checks geometry, values, cuts by the field of view, metal, couch and identifiers,
//! and adds the reader's warnings in the same form. Spatial checks use means over blocks of about
//! 2 mm ordered along the body's axes (left, posterior, superior), so that noise and the order of
//! the voxels do not matter.

mod couch;
mod findings;
mod geometry;
mod histogram;
mod meaning;
mod survey;
mod tissue;
mod values;

use serde::Serialize;

pub use findings::{Finding, FindingCode, Severity};

use crate::scan::{Scan, WarningCode};
use histogram::Histogram;
use survey::Survey;

/// Findings about a scan and the measures behind them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Audit {
    /// Most serious first.
    pub findings: Vec<Finding>,
    /// Measures behind the findings.
    pub measures: Measures,
}

/// Numbers measured on a scan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measures {
    /// Directions of the voxel axes i, j, k as letters L, R, P, A, S, I.
    pub axes: String,
    /// Angle between the slice step and the slices' normal, degrees.
    pub tilt_deg: f64,
    /// Most frequent HU of air; `None` without air.
    pub air_peak_hu: Option<f64>,
    /// Most frequent HU of soft tissue; `None` without soft tissue.
    pub tissue_peak_hu: Option<f64>,
    /// Volume above 300 HU, cm³: bone and metal.
    pub bone_cm3: f64,
    /// Volume above 2500 HU, cm³.
    pub metal_cm3: f64,
    /// Area of tissue in the outermost layers, where the field of view cuts it, cm².
    pub cut_cm2: CutFaces,
    /// Area of tissue at the edge of a round field of view, cm².
    pub cut_by_circle_cm2: f64,
    /// Width of a couch-like plate, mm.
    pub couch_mm: Option<f64>,
}

/// Areas of tissue on the six faces of a volume, cm².
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names say all")]
pub struct CutFaces {
    pub right: f64,
    pub left: f64,
    pub anterior: f64,
    pub posterior: f64,
    pub inferior: f64,
    pub superior: f64,
}

impl Audit {
    /// Audits a scan; takes about as long as reading it.
    pub fn of(scan: &Scan) -> Self {
        let volume = &scan.volume;
        let histogram = Histogram::of(volume.values());
        let survey = Survey::of(volume);
        let mut thick = tissue::thick(&survey);
        let couch = couch::find(&survey, &thick);
        if let Some(couch) = &couch {
            couch.clear(&survey, &mut thick);
        }
        let peaks = values::peaks(&histogram);
        let voxel_cm3 = geometry::voxel_cm3(volume.grid());
        let measures = Measures {
            axes: geometry::letters(volume.grid()),
            tilt_deg: volume.grid().tilt_deg(),
            air_peak_hu: peaks.air_hu,
            tissue_peak_hu: peaks.tissue_hu,
            bone_cm3: histogram.above(values::BONE_HU) as f64 * voxel_cm3,
            metal_cm3: histogram.above(values::METAL_HU) as f64 * voxel_cm3,
            cut_cm2: tissue::cut_faces(&survey, &thick),
            cut_by_circle_cm2: tissue::cut_by_circle(&survey, &thick),
            couch_mm: couch.as_ref().map(|couch| couch.width_mm),
        };

        let mut findings = Vec::new();
        findings.extend(scan.warnings.iter().map(Finding::of_warning));
        findings.extend(geometry::check(scan, &measures));
        findings.extend(findings::identifiers(&scan.acquisition));
        let scale = values::scale(&peaks);
        let hounsfield = findings.iter().chain(&scale).all(|finding| {
            let not_hu = FindingCode::Reader(WarningCode::NotHu);
            ![not_hu, FindingCode::ShiftedValues].contains(&finding.code)
        });
        findings.extend(scale);
        // Checks of HU are meaningless for values in other units.
        if hounsfield {
            findings.extend(values::check(
                &histogram,
                &peaks,
                &measures,
                &scan.acquisition,
            ));
            findings.extend(tissue::check(&measures));
            let position = scan.acquisition.patient_position.as_deref();
            findings.extend(couch.map(|couch| couch.finding(position)));
        }

        let mut seen = Vec::new();
        findings.retain(|finding| {
            let new = !seen.contains(&finding.code);
            seen.push(finding.code);
            new
        });
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        Self { findings, measures }
    }
}
