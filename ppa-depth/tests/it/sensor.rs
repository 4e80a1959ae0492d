//! The sensor model on scenes whose answer can be derived.

use nalgebra::{Isometry3, Point3};
use ppa_depth::{
    Backdrop, Body, Camera, CameraModel, CameraSpec, DepthError, DepthMode, FieldMask,
    Invalidation, MeshBody, Multipath, PlacedBody, RandomError, SampledImage, Sensor, SensorError,
    SensorSpec, SystematicError,
};

use crate::shapes::sphere;

pub const NONE: SensorSpec = SensorSpec {
    random: None,
    systematic: None,
    mixed: None,
    invalid: None,
    multipath: None,
};

pub fn pinhole(side: u32, focal: f64) -> CameraSpec {
    let centre = f64::from(side - 1) / 2.0;
    CameraSpec {
        model: CameraModel::Pinhole,
        width: side,
        height: side,
        fx: focal,
        fy: focal,
        cx: centre,
        cy: centre,
        k1: 0.0,
        k2: 0.0,
        k3: 0.0,
        k4: 0.0,
        k5: 0.0,
        k6: 0.0,
        p1: 0.0,
        p2: 0.0,
        metric_radius: None,
        ..CameraSpec::azure_kinect(DepthMode::NfovBinned)
    }
}

/// A rectangle from (x0, −9 m) to (x1, 9 m), perpendicular to the axis at depth `z_mm`.
pub fn wall(x0: f32, x1: f32, z_mm: f32) -> Body {
    let corners =
        [(x0, -9e3), (x1, -9e3), (x1, 9e3), (x0, 9e3)].map(|(x, y)| Point3::new(x, y, z_mm));
    MeshBody::new(&corners, &[[0, 1, 2], [0, 2, 3]])
        .unwrap()
        .into()
}

pub fn view(camera: &Camera, behind: &[&Body], before: &Body) -> SampledImage {
    let placed = |body| PlacedBody {
        body,
        camera_from_body: Isometry3::identity(),
    };
    let backdrop: Vec<_> = behind.iter().map(|body| placed(body)).collect();
    Backdrop::new(camera, &backdrop)
        .before(camera, &[placed(before)])
        .unwrap()
}

pub fn sensor(spec: SensorSpec) -> Sensor {
    Sensor::new(spec, 5).unwrap()
}

#[test]
fn with_all_parts_left_out_the_image_is_the_ideal_one() {
    let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovBinned)).unwrap();
    let seen = view(
        &camera,
        &[&wall(-9e3, 9e3, 1500.0)],
        &wall(-100.0, 30.0, 1100.0),
    );
    let image = sensor(NONE).observe(&camera, &seen, 1, 0).unwrap();
    for (a, b) in image.z_mm.iter().zip(&seen.image.z_mm) {
        assert!((a - b).abs() < 1e-3);
    }
}

#[test]
fn an_image_of_another_camera_is_refused() {
    let camera = Camera::try_from(pinhole(8, 200.0)).unwrap();
    let seen = view(&camera, &[], &wall(-9e3, 9e3, 1500.0));
    let wider = Camera::try_from(pinhole(9, 200.0)).unwrap();
    let refused = sensor(NONE).observe(&wider, &seen, 1, 0).unwrap_err();
    assert!(
        matches!(refused, DepthError::OtherCamera { .. }),
        "{refused}"
    );
}

/// The sum of squares of (measured − true range) / σ is χ² distributed; 4 standard errors.
#[test]
fn the_random_error_grows_as_the_signal_falls() {
    let camera = Camera::try_from(pinhole(200, 200.0)).unwrap();
    let seen = view(&camera, &[], &wall(-9e3, 9e3, 1500.0));
    let random = RandomError {
        floor_mm: 0.5,
        at_unit_signal_mm: 1.5,
    };
    let noisy = sensor(SensorSpec {
        random: Some(random),
        ..NONE
    });
    let image = noisy.observe(&camera, &seen, 8, 3).unwrap();
    let n = image.z_mm.len() as f64;
    let scaled = |(ray, z): (&Option<nalgebra::Vector2<f64>>, &f32)| {
        let length = (1.0 + ray.unwrap().norm_squared()).sqrt();
        let range = 1500.0 * length;
        // Square to the wall's normal the cosine of incidence is 1 / length.
        let signal = 1e6 / (range * range * length);
        let sigma = (0.25 + (1.5 / signal).powi(2)).sqrt();
        (f64::from(*z) * length - range) / sigma
    };
    let scaled: Vec<f64> = camera.rays().iter().zip(&image.z_mm).map(scaled).collect();
    let mean = scaled.iter().sum::<f64>() / n;
    let square = scaled.iter().map(|x| x * x).sum::<f64>() / n;
    assert!(mean.abs() < 4.0 / n.sqrt(), "{mean}");
    assert!(
        (square - 1.0).abs() < 4.0 * (2.0 / n).sqrt() + 0.01,
        "{square}"
    );
    // Addressed: other threads give the same image, another frame differs.
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert_eq!(
        one.install(|| noisy.observe(&camera, &seen, 8, 3).unwrap()),
        image
    );
    assert_ne!(noisy.observe(&camera, &seen, 8, 4).unwrap(), image);
    assert_ne!(noisy.observe(&camera, &seen, 9, 3).unwrap(), image);
}

#[test]
fn the_systematic_error_stays_with_the_device() {
    let camera = Camera::try_from(pinhole(8, 200.0)).unwrap();
    let error_at = |z_mm: f32, seed: u64, frame: u64| {
        let seen = view(&camera, &[], &wall(-9e3, 9e3, z_mm));
        let spec = SensorSpec {
            systematic: Some(SystematicError {
                offset_mm: 5.0,
                per_metre_mm: 2.0,
                fixed_pattern_mm: 0.0,
            }),
            ..NONE
        };
        let image = Sensor::new(spec, seed)
            .unwrap()
            .observe(&camera, &seen, frame, frame)
            .unwrap();
        f64::from(image.z_mm[0] - z_mm)
    };
    let errors: Vec<f64> = (0..400).map(|seed| error_at(1000.0, seed, 0)).collect();
    assert_eq!(error_at(1000.0, 7, 0), error_at(1000.0, 7, 9));
    // Offset and slope are independent: variance 5² + 2² along the ray; its standard error is √(2/400).
    let variance = errors.iter().map(|e| e * e).sum::<f64>() / 400.0;
    assert!(
        (variance / 29.0 - 1.0).abs() < 4.0 * (2.0 / 400.0_f64).sqrt(),
        "{variance}"
    );
    let slopes = (0..400).map(|seed| (error_at(2000.0, seed, 0) - errors[seed as usize]).powi(2));
    let slopes = slopes.sum::<f64>() / 400.0;
    assert!(
        (slopes / 4.0 - 1.0).abs() < 4.0 * (2.0 / 400.0_f64).sqrt(),
        "{slopes}"
    );
}

/// The offset of a pixel is the same in every frame, and different for every pixel and device.
#[test]
fn the_fixed_pattern_stays_with_the_pixel() {
    let camera = Camera::try_from(pinhole(100, 2000.0)).unwrap();
    let seen = view(&camera, &[], &wall(-9e3, 9e3, 1000.0));
    let fixed = SensorSpec {
        systematic: Some(SystematicError {
            offset_mm: 0.0,
            per_metre_mm: 0.0,
            fixed_pattern_mm: 3.0,
        }),
        random: Some(RandomError {
            floor_mm: 0.0,
            at_unit_signal_mm: 0.0,
        }),
        ..NONE
    };
    let frame = |device: u64, frame: u64| {
        let sensor = Sensor::new(fixed.clone(), device).unwrap();
        sensor.observe(&camera, &seen, 1, frame).unwrap()
    };
    let image = frame(5, 0);
    assert_eq!(image, frame(5, 7));
    assert_ne!(image, frame(6, 0));
    let errors: Vec<f64> = image.z_mm.iter().map(|z| f64::from(z - 1000.0)).collect();
    let n = errors.len() as f64;
    let variance = errors.iter().map(|e| e * e).sum::<f64>() / n;
    assert!(
        (variance / 9.0 - 1.0).abs() < 4.0 * (2.0 / n).sqrt() + 0.01,
        "{variance}"
    );
    let beside: f64 = errors.windows(2).map(|pair| pair[0] * pair[1]).sum();
    assert!((beside / n / 9.0).abs() < 4.0 / n.sqrt());
}

#[test]
fn dim_and_oblique_pixels_are_given_up() {
    let camera = Camera::try_from(pinhole(101, 50.0)).unwrap();
    let seen = view(&camera, &[], &wall(-9e3, 9e3, 1500.0));
    let lost = |min_signal: f64, max_angle_deg: f64| {
        let invalid = Invalidation {
            min_signal,
            max_angle_deg,
            min_contrast: 0.0,
        };
        let spec = SensorSpec {
            invalid: Some(invalid),
            ..NONE
        };
        sensor(spec).observe(&camera, &seen, 1, 0).unwrap().z_mm
    };
    for (ray, (dim, oblique)) in camera
        .rays()
        .iter()
        .zip(lost(0.2, 90.0).iter().zip(lost(0.0, 40.0)))
    {
        let length = (1.0 + ray.unwrap().norm_squared()).sqrt();
        let signal = (1.5 * length).powi(-2) / length;
        let angle = (1.0 / length).acos().to_degrees();
        if (signal - 0.2).abs() > 1e-3 {
            assert_eq!(*dim == 0.0, signal < 0.2);
        }
        if (angle - 40.0).abs() > 0.1 {
            assert_eq!(oblique == 0.0, angle > 40.0, "{angle}");
        }
    }
}

/// Inside a sphere every patch sends every other the same: ρ E A / 4πR². Seen from its centre through a cone of half angle α, the
/// pixel on the axis is then too far by (2/3) ρ R sin³(α/2) / (1 + ρ (1 − cos α)/2), as long as phases are small.
#[test]
fn one_bounce_inside_a_sphere_lengthens_the_range_as_derived() {
    let mut spec = pinhole(300, 200.0);
    spec.mask = Some(FieldMask::Circle { diameter_deg: 70.0 });
    let camera = Camera::try_from(spec).unwrap();
    let (vertices, triangles, _) = sphere(1000.0, 6);
    let body = Body::from(MeshBody::new(&vertices, &triangles).unwrap());
    let seen = view(&camera, &[], &body);
    let (albedo, half) = (0.8, 35.0_f64.to_radians());
    let bounced = sensor(SensorSpec {
        multipath: Some(Multipath {
            albedo,
            modulation_mhz: 1.0,
        }),
        ..NONE
    });
    let image = bounced.observe(&camera, &seen, 1, 0).unwrap();
    let middle = 150 * 300 + 150;
    let longer_mm = f64::from(image.z_mm[middle] - seen.image.z_mm[middle]);
    let expected_mm = 2.0 / 3.0 * albedo * 1000.0 * (half / 2.0).sin().powi(3)
        / (1.0 + albedo * (1.0 - half.cos()) / 2.0);
    assert!(
        (longer_mm / expected_mm - 1.0).abs() < 0.03,
        "{longer_mm} instead of {expected_mm} mm"
    );
}

#[test]
fn what_is_hidden_by_the_backdrop_is_refused() {
    let camera = Camera::try_from(pinhole(20, 50.0)).unwrap();
    let placed = |body| PlacedBody {
        body,
        camera_from_body: Isometry3::identity(),
    };
    let (near, far) = (wall(-9e3, 9e3, 1000.0), wall(-100.0, 100.0, 1200.0));
    let backdrop = Backdrop::new(&camera, &[placed(&near)]);
    assert!(matches!(
        backdrop.before(&camera, &[placed(&far)]),
        Err(DepthError::Hidden { .. })
    ));
    let backdrop = Backdrop::new(&camera, &[placed(&far)]);
    assert!(backdrop.before(&camera, &[placed(&near)]).is_ok());
}

#[test]
fn numbers_that_make_no_sensor_are_named() {
    let named = |change: fn(&mut SensorSpec)| {
        let mut spec = SensorSpec::default();
        change(&mut spec);
        let SensorError::Parameter { name, .. } = Sensor::new(spec, 0).unwrap_err() else {
            unreachable!()
        };
        name
    };
    assert_eq!(
        named(|s| s.random.as_mut().unwrap().floor_mm = -1.0),
        "random.floor_mm"
    );
    assert_eq!(
        named(|s| s.mixed.as_mut().unwrap().modulation_mhz = 0.0),
        "mixed.modulation_mhz"
    );
    assert_eq!(
        named(|s| s.invalid.as_mut().unwrap().min_contrast = f64::NAN),
        "invalid.min_contrast"
    );
    assert!(Sensor::new(SensorSpec::default(), 0).is_ok());
}
