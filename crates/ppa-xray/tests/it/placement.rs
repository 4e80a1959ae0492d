//! Geometry and settings that make no sense are refused with the reason.

use nalgebra::Isometry3;
use ppa_xray::{
    AnalogSettings, FastSettings, ProjectionError, Spectrum, TransportError, analog, fast,
};

use crate::scenes::{frontal, slab};

fn refused(change: impl FnOnce(&mut ppa_xray::Projection)) -> ProjectionError {
    let mut projection = frontal(20, 10.0);
    change(&mut projection);
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    let settings = AnalogSettings {
        histories: 10,
        seed: 0,
        ..AnalogSettings::default()
    };
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
    assert_eq!(nan, ProjectionError::Pose);
    assert!(matches!(
        refused(|p| p.detector.rows = 0),
        ProjectionError::PixelCount { rows: 0, .. }
    ));
    assert!(matches!(
        refused(|p| p.detector.pixel_mm = -1.0),
        ProjectionError::Length { .. }
    ));
}

#[test]
fn settings_out_of_range_are_named() {
    let (phantom, projection) = (slab(100.0, 1.0), frontal(20, 10.0));
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    for (settings, word) in [
        (
            FastSettings {
                dose_histories: 0.0,
                ..FastSettings::default()
            },
            "noise",
        ),
        (
            FastSettings {
                scatter_histories: 0,
                ..FastSettings::default()
            },
            "scatter",
        ),
        (
            FastSettings {
                scatter_pixel_mm: f64::NAN,
                ..FastSettings::default()
            },
            "cells",
        ),
        (
            FastSettings {
                samples_per_side: 0,
                scatter_histories: 1,
                ..FastSettings::default()
            },
            "rays",
        ),
    ] {
        let error = fast(&phantom, &spectrum, &projection, &settings).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
    let soft = Spectrum::monoenergetic(3.0).unwrap();
    let one = AnalogSettings {
        histories: 1,
        seed: 0,
        ..AnalogSettings::default()
    };
    assert!(matches!(
        analog(&phantom, &soft, &projection, &one),
        Err(TransportError::Spectrum { .. })
    ));
}
