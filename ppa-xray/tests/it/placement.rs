//! Invalid geometry and settings are refused with the reason.

use nalgebra::{Isometry3, Unit, Vector3};
use ppa_xray::{
    AnalogSettings, Blur, Collimation, Detector, FastSettings, HeelEffect, ProjectionError,
    Spectrum, TransportError, analog, fast,
};

use crate::scenes::{frontal, slab};

fn refused(change: impl FnOnce(&mut ppa_xray::Projection)) -> ProjectionError {
    let mut projection = frontal(20, 10.0);
    change(&mut projection);
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    let settings = AnalogSettings::default().with_histories(10).with_seed(0);
    match analog(&slab(100.0, 1.0), &spectrum, &projection, &settings) {
        Err(TransportError::Projection(error)) => error,
        other => panic!("expected a refusal, got {other:?}"),
    }
}

#[test]
fn impossible_placements_are_named() {
    let inside = refused(|p| p.source_detector_mm = 1_010.0);
    assert!(matches!(
        inside,
        ProjectionError::DetectorInsidePhantom { .. }
    ));
    let source = refused(|p| p.ct_from_device = Isometry3::translation(0.0, 0.0, -10.0));
    assert!(matches!(
        source,
        ProjectionError::SourceInsidePhantom { .. }
    ));
    let aside = refused(|p| p.ct_from_device = Isometry3::translation(900.0, 0.0, -1_000.0));
    assert_eq!(aside, ProjectionError::FieldMissesPhantom);
    let behind = refused(|p| p.ct_from_device = Isometry3::translation(0.0, 0.0, 500.0));
    assert_eq!(behind, ProjectionError::FieldMissesPhantom);
    let nan = refused(|p| p.ct_from_device = Isometry3::translation(f64::NAN, 0.0, 0.0));
    assert_eq!(
        nan,
        ProjectionError::NotFinite {
            what: "device pose"
        }
    );
    assert!(matches!(
        refused(|p| p.detector.rows = 0),
        ProjectionError::PixelCount { rows: 0, .. }
    ));
    assert!(matches!(
        refused(|p| p.detector.pixel_mm = -1.0),
        ProjectionError::Length { .. }
    ));
}

/// Each message is one clear sentence that names the number.
#[test]
fn impossible_sources_and_receptors_are_named() {
    let field = |size_mm, centre_mm| Collimation::Rectangle { size_mm, centre_mm };
    let sentence = |change: fn(&mut ppa_xray::Projection)| refused(change).to_string();
    assert!(sentence(|p| p.source.focal_spot.size_mm = -1.0).contains("focal spot is -1 mm"));
    assert!(sentence(|p| p.source.focal_spot.size_mm = f64::NAN).contains("NaN"));
    assert!(sentence(|p| p.source.focal_spot.size_mm = 100.0).contains("focal spot"));
    let heel = sentence(|p| {
        p.source.heel_effect = Some(HeelEffect::new(0.0));
    });
    assert!(heel.contains("tube model"), "{heel}"); // the spectrum is a line
    for (collimation, word) in [
        (field([0.0, 100.0], [0.0; 2]), "measures"),
        (field([-10.0, 100.0], [0.0; 2]), "measures"),
        (field([f64::NAN, 100.0], [0.0; 2]), "measures"),
        (field([100.0, 100.0], [1e6, 0.0]), "x-ray field reaches"),
        (
            Collimation::Fan {
                angles_deg: [0.0, 5.0],
            },
            "opening angles",
        ),
        (
            Collimation::Fan {
                angles_deg: [5.0, 180.0],
            },
            "opening angles",
        ),
    ] {
        let error = refused(|p| p.source.collimation = collimation).to_string();
        assert!(error.contains(word), "{error}");
    }
    let beside = refused(|p| p.source.collimation = field([100.0, 100.0], [900.0, 0.0]));
    assert_eq!(beside, ProjectionError::FieldMissesPhantom);
    assert!(sentence(|p| p.detector.centre_mm[0] = f64::NAN).contains("expected"));
    let large = refused(|p| p.detector = Detector::centred(30_000, 30_000, 0.01));
    assert!(
        matches!(large, ProjectionError::TooManyPixels { .. }),
        "{large}"
    );
    assert!(
        sentence(|p| p.central_ray = Unit::new_normalize(Vector3::new(0.0, 20.0, 1.0)))
            .contains("central ray")
    );
    assert!(sentence(|p| p.receptor.electronic_noise_kev = -1.0).contains("electronic noise"));
    let blur = sentence(|p| p.receptor.blur = Some(Blur::lorentzian(f64::NAN)));
    assert!(blur.contains("NaN"), "{blur}");
}

#[test]
fn settings_out_of_range_are_named() {
    let (phantom, projection) = (slab(100.0, 1.0), frontal(20, 10.0));
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    for (settings, word) in [
        (FastSettings::default().with_dose_histories(0.0), "noise"),
        (FastSettings::default().with_scatter_histories(0), "scatter"),
        (
            FastSettings::default().with_scatter_pixel_mm(f64::NAN),
            "points",
        ),
        (
            FastSettings::default()
                .with_samples_per_side(0)
                .with_scatter_histories(1),
            "rays",
        ),
    ] {
        let error = fast(&phantom, &spectrum, &projection, &settings).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
    let soft = Spectrum::monoenergetic(3.0).unwrap();
    let one = AnalogSettings::default().with_histories(1).with_seed(0);
    assert!(matches!(
        analog(&phantom, &soft, &projection, &one),
        Err(TransportError::Spectrum { .. })
    ));
}
