//! Small motion between frames.

use nalgebra::{Point3, Vector3};
use ppa_depth::{SensorError, Tremor};

#[test]
fn a_tremor_keeps_its_size_and_its_memory() {
    let tremor = Tremor {
        shift_mm: 0.7,
        turn_deg: 0.2,
        correlation_frames: 6.0,
    };
    let pivot = Point3::new(10.0, -20.0, 900.0);
    let moved = |frame: u64| tremor.motion(&pivot, 11, frame) * pivot - pivot;
    let n = 6000;
    let path: Vec<Vector3<f64>> = (0..n).map(moved).collect();
    let mean = |lag: usize| {
        let pairs = path.iter().zip(&path[lag..]).map(|(a, b)| a.dot(b) / 3.0);
        pairs.sum::<f64>() / (path.len() - lag) as f64
    };
    // Some 6000 / 15 independent values on three axes: standard error √(2 / 1200) = 4 %.
    let variance = mean(0);
    assert!((variance / 0.49 - 1.0).abs() < 0.16, "{variance}");
    assert!((mean(6) / 0.49 - (-1.0_f64).exp()).abs() < 0.16);
    assert_eq!(moved(17), path[17]);
    let turned = tremor.motion(&pivot, 11, 5).rotation.angle().to_degrees();
    assert!(0.0 < turned && turned < 1.2);
}

#[test]
fn numbers_that_make_no_tremor_are_named() {
    let tremor = |shift_mm, turn_deg, correlation_frames| {
        let tremor = Tremor {
            shift_mm,
            turn_deg,
            correlation_frames,
        };
        match tremor.check() {
            Ok(()) => "",
            Err(SensorError::Parameter { name, .. }) => name,
            Err(_) => unreachable!(),
        }
    };
    assert_eq!(tremor(0.5, 0.1, 10.0), "");
    assert_eq!(tremor(f64::NAN, 0.1, 10.0), "tremor.shift_mm");
    assert_eq!(tremor(0.5, -1.0, 10.0), "tremor.turn_deg");
    assert_eq!(tremor(0.5, 0.1, 1e6), "tremor.correlation_frames");
}
