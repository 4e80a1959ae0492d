//! Where the axis of a knee is measured.

use crate::landmarks::choices::LandmarkError;

/// Joint region and far region of a knee, mm proximal of the joint level; `extent_mm` is how far the limb reaches distal
/// (below 0) and proximal of it.
///
/// For an AP radiograph the leg is rotated about its long axis, from hip to ankle. The tibia's shaft runs along it
/// within about 2 degrees; the femur's is inclined to it by about 6 degrees to the outside. So the tibia gives the axis if at least
/// 100 mm of it are visible, otherwise the femur; if the scan shows 50 mm on either side, both together do.
///
/// # Errors
/// [`LandmarkError::ShortKnee`] if it shows less.
pub(crate) fn knee_ranges(extent_mm: [f64; 2]) -> Result<[[f64; 2]; 2], LandmarkError> {
    // Nearer than 65 mm the tibia flares to plateau and tuberosity, nearer than 75 mm the femur to its condyles.
    const TIBIA_MM: [[f64; 2]; 2] = [[-95.0, -65.0], [-150.0, -110.0]];
    const FEMUR_MM: [[f64; 2]; 2] = [[75.0, 105.0], [120.0, 160.0]];
    const BOTH: [f64; 2] = [0.6, 1.0];
    const ENOUGH_MM: f64 = 100.0;
    let [distal_mm, proximal_mm] = [-extent_mm[0], extent_mm[1]];
    let drawn = |ranges: [[f64; 2]; 2], reach_mm: f64, full_mm: f64| {
        let scale = (reach_mm / full_mm).min(1.0);
        ranges.map(|range| range.map(|end| end * scale))
    };
    if distal_mm >= ENOUGH_MM {
        Ok(drawn(TIBIA_MM, distal_mm, 150.0))
    } else if proximal_mm >= ENOUGH_MM {
        Ok(drawn(FEMUR_MM, proximal_mm, 160.0))
    } else if distal_mm.min(proximal_mm) >= 0.5 * ENOUGH_MM {
        let near = BOTH.map(|share| share * proximal_mm);
        Ok([[-BOTH[1] * distal_mm, -BOTH[0] * distal_mm], near])
    } else {
        Err(LandmarkError::ShortKnee {
            distal_mm,
            proximal_mm,
            expected_mm: ENOUGH_MM,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tibia_gives_the_axis_where_enough_is_seen() {
        let ranges = |distal: f64, proximal: f64| knee_ranges([-distal, proximal]);
        assert_eq!(ranges(200.0, 300.0), Ok([[-95.0, -65.0], [-150.0, -110.0]]));
        assert_eq!(ranges(99.0, 300.0), Ok([[75.0, 105.0], [120.0, 160.0]]));
        assert_eq!(ranges(60.0, 80.0), Ok([[-60.0, -36.0], [48.0, 80.0]]));
        let short = ranges(49.0, 99.0).unwrap_err();
        assert!(matches!(short, LandmarkError::ShortKnee { .. }), "{short}");
    }

    /// Regions never leave the limb, whichever part of it is visible.
    #[test]
    fn regions_lie_inside_the_limb_and_apart() {
        for distal in [0.0, 50.0, 99.0, 100.0, 120.0, 400.0] {
            for proximal in [0.0, 50.0, 99.0, 100.0, 140.0, 500.0] {
                let Ok([near, far]) = knee_ranges([-distal, proximal]) else {
                    continue;
                };
                for [from, to] in [near, far] {
                    assert!(-distal - 1e-9 <= from && from < to && to <= proximal + 1e-9);
                }
                assert!(near[1] < far[0] || far[1] < near[0], "{near:?} {far:?}");
            }
        }
    }
}
