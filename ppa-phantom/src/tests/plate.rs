//! Plate and screws.

use nalgebra::{Unit, Vector3};

use crate::*;

#[test]
fn the_plate_lies_on_the_fibula_with_screws_inside() {
    for name in ["P01", "P02", "P09"] {
        let plain = LowerLeg::family(name, Side::Right).unwrap();
        let leg = plain.clone().with_plate();
        let middle = leg.mortise_point(-28.0, 3.5, 52.0);
        let half = Vector3::new(25.0, 25.0, 40.0);
        let ct = leg
            .voxelise_box([middle - half, middle + half], 1.0, TableTop::Absent)
            .unwrap();
        let (mut metal, mut in_fibula, mut counted) = (0.0, 0.0, 0.0);
        for (index, hu) in ct.hu().iter().enumerate() {
            let p = ct.grid().centre(ct.grid().voxel(index).map(|v| v as f64));
            counted += f64::from(*hu > 2500.0);
            if leg.tissue(&p) == Tissue::Titanium {
                metal += 1.0;
                in_fibula += f64::from(plain.bone(&p) == Some("fibula"));
                assert!(leg.skin_distance_mm(&p) < -1.5, "{name}: metal at the skin");
                assert!([None, Some("fibula")].contains(&plain.bone(&p)), "{name}");
            }
        }
        // 64 x 10 x 2.5 mm of plate, bent, and five screws of 3.5 mm.
        assert!((1500.0..3500.0).contains(&metal), "{name}: {metal} mm³");
        assert!(
            (150.0..900.0).contains(&in_fibula),
            "{name}: {in_fibula} mm³"
        );
        assert!(counted > 0.4 * metal, "{name}: {counted} bright voxels");
        let along = Unit::new_normalize(leg.mortise_point(-10.0, 3.5, 52.0) - middle);
        let start = middle - along.scale(60.0);
        let chords = leg.chords(&start, &along, 150.0);
        assert!(
            chords.iter().any(|c| c.tissue == Tissue::Titanium),
            "{name}: {chords:?}"
        );
    }
}
