//! Recovery of the noise of recordings simulated by the sensor model.

use nalgebra::Point3;
use ppa_depth::{
    Body, Camera, DepthImage, FitError, Invalidation, MeshBody, RandomError, SampledImage,
    SensorSpec, fit_noise,
};

use crate::sensor::{NONE, pinhole, sensor, view};

/// A wall about a metre away, tilted so that it gives many signals.
fn tilted_wall(camera: &Camera) -> SampledImage {
    let tilted = [(-2e3, -2e3), (2e3, -2e3), (2e3, 2e3), (-2e3, 2e3)]
        .map(|(x, y)| Point3::new(x, y, 1200.0 + 0.4 * x));
    let body = Body::from(MeshBody::new(&tilted, &[[0, 1, 2], [0, 2, 3]]).unwrap());
    view(camera, &[], &body)
}

/// The simulated noise is recovered, rounding to millimetres included.
#[test]
fn the_noise_of_a_recording_is_found_again() {
    let camera = Camera::try_from(pinhole(160, 120.0)).unwrap();
    let seen = tilted_wall(&camera);
    let (floor_mm, at_unit_signal_mm) = (0.5, 0.5);
    let noisy = sensor(SensorSpec {
        random: Some(RandomError {
            floor_mm,
            at_unit_signal_mm,
        }),
        ..NONE
    });
    let frames: Vec<DepthImage> = (0..40)
        .map(|frame| {
            let mut image = noisy.observe(&camera, &seen, 3, frame).unwrap();
            image.z_mm.iter_mut().for_each(|z| *z = z.round());
            image
        })
        .collect();
    let fit = fit_noise(&camera, &frames, true).unwrap();
    // Edges of the classes and normals from rounded depths leave some per cent.
    assert!(
        (fit.random.floor_mm / floor_mm - 1.0).abs() < 0.1,
        "{fit:?}"
    );
    assert!(
        (fit.random.at_unit_signal_mm / at_unit_signal_mm - 1.0).abs() < 0.05,
        "{fit:?}"
    );
    assert!(fit.relative_misfit < 0.03 && fit.min_signal.is_none());
    let frames = &frames[..3];
    assert!(matches!(
        fit_noise(&camera, &frames[..2], true),
        Err(FitError::Frames(2))
    ));
    let still = vec![frames[0].clone(); 3];
    assert!(matches!(
        fit_noise(&camera, &still, true),
        Err(FitError::Quiet(0))
    ));
    let small = vec![DepthImage::empty(3, 3); 3];
    assert!(matches!(
        fit_noise(&camera, &small, true),
        Err(FitError::Size { frame: 0, .. })
    ));
    let nothing = vec![DepthImage::empty(160, 160); 3];
    assert!(matches!(
        fit_noise(&camera, &nothing, true),
        Err(FitError::Pixels(0))
    ));
}

/// Far away, the noise of neighbouring pixels exceeds their distance; it must not enter the angle of incidence.
#[test]
fn the_noise_of_few_frames_far_away_is_unbiased() {
    let camera = Camera::try_from(pinhole(200, 504.0)).unwrap();
    let steep = [(-2e3, -2e3), (2e3, -2e3), (2e3, 2e3), (-2e3, 2e3)]
        .map(|(x, y)| Point3::new(x, y, 2500.0 + 2.0 * x));
    let body = Body::from(MeshBody::new(&steep, &[[0, 1, 2], [0, 2, 3]]).unwrap());
    let seen = view(&camera, &[], &body);
    let noisy = sensor(SensorSpec {
        random: Some(RandomError {
            floor_mm: 0.0,
            at_unit_signal_mm: 1.14,
        }),
        ..NONE
    });
    for count in [3, 10] {
        let frames = (0..count).map(|frame| noisy.observe(&camera, &seen, 3, frame).unwrap());
        let fit = fit_noise(&camera, &frames.collect::<Vec<_>>(), false).unwrap();
        let RandomError {
            floor_mm,
            at_unit_signal_mm,
        } = fit.random;
        assert!((at_unit_signal_mm / 1.14 - 1.0).abs() < 0.03, "{fit:?}");
        // Of a noise of 10 to 40 mm.
        assert!(floor_mm < 1.5, "{fit:?}");
    }
}

/// Pixels that are rejected below a signal are missing in every frame; the signals of a class of pixels are some 5 % apart.
#[test]
fn the_least_signal_of_a_recording_is_found_again() {
    let camera = Camera::try_from(pinhole(160, 120.0)).unwrap();
    let seen = tilted_wall(&camera);
    let device = sensor(SensorSpec {
        random: Some(RandomError {
            floor_mm: 0.5,
            at_unit_signal_mm: 0.5,
        }),
        invalid: Some(Invalidation {
            min_signal: 0.4,
            max_angle_deg: 90.0,
            min_contrast: 0.0,
        }),
        ..NONE
    });
    let frames: Vec<DepthImage> = (0..5)
        .map(|frame| {
            let mut image = device.observe(&camera, &seen, 3, frame).unwrap();
            // Half of the frames show pixels that the others lack, as at the limit of a device.
            if frame == 0 {
                image = seen.image.clone();
            }
            image
        })
        .collect();
    let fit = fit_noise(&camera, &frames, false).unwrap();
    let found = fit.min_signal.unwrap();
    assert!((found / 0.4 - 1.0).abs() < 0.1, "{found}");
}
