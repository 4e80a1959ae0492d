//! Positions of source and detector in an MC-GPU scan.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use crate::mcgpu::input::Input;

/// Tolerance of the angles of interest, degrees, as in MC-GPU.
const SLACK_DEG: f64 = 1e-5;

/// Source and detector of one projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Number of the projection in the whole scan, from 0.
    pub number: u32,
    /// Angle of the source as seen from the axis, degrees; 0 is along x, 90 along y. Not reduced to one revolution.
    pub angle_deg: f64,
    /// Focal spot, cm.
    pub source_cm: Point3<f64>,
    /// Direction of the central beam.
    pub direction: Unit<Vector3<f64>>,
}

impl Input {
    /// The projections within the angles of interest. A single exposure without a scan is always included.
    ///
    /// The first one is that of the input file. The source then rotates about an axis along z that intersects the first central beam,
    /// and rises; the beam keeps pointing at the axis.
    pub fn stations(&self) -> Vec<Station> {
        let trajectory = &self.trajectory;
        let [u, v, _] = self.direction.into_inner().into();
        // The source is opposite to the direction of the beam.
        let first_deg = if u as f32 == -1.0 {
            // MC-GPU takes the angle from u in single precision: rounding errors of v are no turn of 360 degrees.
            0.0
        } else {
            (-v).atan2(-u).to_degrees().rem_euclid(360.0)
        };
        if trajectory.projections == 1 {
            return vec![Station {
                number: 0,
                angle_deg: first_deg,
                source_cm: self.source_cm,
                direction: self.direction,
            }];
        }
        let radius_cm = trajectory.source_axis_cm;
        let axis_cm = self.source_cm + self.direction.into_inner() * radius_cm;
        let [from_deg, to_deg] = trajectory.angles_of_interest_deg;
        (0..trajectory.projections)
            .map(|number| {
                let angle_deg = first_deg + f64::from(number) * trajectory.step_deg;
                let (sin, cos) = angle_deg.to_radians().sin_cos();
                let rise_cm = f64::from(number) * trajectory.rise_cm;
                Station {
                    number,
                    angle_deg,
                    source_cm: Point3::new(
                        axis_cm.x + radius_cm * cos,
                        axis_cm.y + radius_cm * sin,
                        self.source_cm.z + rise_cm,
                    ),
                    direction: Unit::new_normalize(Vector3::new(-cos, -sin, 0.0)),
                }
            })
            .filter(|station| {
                (from_deg - SLACK_DEG..=to_deg + SLACK_DEG).contains(&station.angle_deg)
            })
            .collect()
    }
}

impl Station {
    /// Pose of the device in the frame of the voxel box, in mm.
    ///
    /// Pixel columns of MC-GPU run along (v, −u, 0) and are those of the device. Its rows run towards z, opposite to device
    /// y: with columns to the right and the beam pointing away from the viewer, device y points down.
    pub fn ct_from_device(&self) -> Isometry3<f64> {
        let beam = self.direction.into_inner();
        let across = Vector3::new(beam.y, -beam.x, 0.0);
        // For a beam along z any column direction would do; MC-GPU uses x.
        let columns = across.try_normalize(1e-4).unwrap_or_else(Vector3::x);
        let columns = (columns - beam * beam.dot(&columns)).normalize();
        let axes = Matrix3::from_columns(&[columns, beam.cross(&columns), beam]);
        let rotation = Rotation3::from_matrix_unchecked(axes);
        Isometry3::from_parts(
            Translation3::from(self.source_cm.coords * 10.0),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcgpu::mangled;

    fn input(change: impl FnOnce(&mut Input)) -> Input {
        let sample = include_str!("sample.in");
        let mut input = mangled::read(sample.as_bytes(), |path| Input::read(path)).unwrap();
        change(&mut input);
        input
    }

    #[test]
    fn rounding_errors_of_the_direction_are_no_turn() {
        let found = |y: f64| {
            let turned = |input: &mut Input| {
                input.direction = Unit::new_normalize(Vector3::new(-1.0, y, 0.0));
                input.trajectory.angles_of_interest_deg = [0.0, 360.0];
            };
            let stations = input(turned).stations();
            stations
                .iter()
                .map(|s| s.angle_deg.round())
                .collect::<Vec<_>>()
        };
        let expected = found(0.0);
        assert_eq!(expected[0], 0.0);
        for y in [1e-17, 1.2246e-16, -1.2246e-16] {
            assert_eq!(found(y), expected, "{y}");
        }
    }

    /// Values that MC-GPU v1.3 prints for `sample.in` with these changes ("Setting the sources and detectors").
    #[test]
    fn the_source_turns_as_in_mcgpu() {
        let stations = input(|_| {}).stations();
        let found: Vec<_> = stations
            .iter()
            .map(|s| (s.number, s.angle_deg.round()))
            .collect();
        assert_eq!(found, [(0, 270.0), (1, 315.0), (2, 360.0)]);
        let near = |found: &Station, source_cm: [f64; 3], direction: [f64; 3]| {
            assert!(
                (found.source_cm - Point3::from(source_cm)).norm() < 1e-6,
                "{found:?}"
            );
            assert!((found.direction.into_inner() - Vector3::from(direction)).norm() < 1e-6);
        };
        let half = 0.5_f64.sqrt();
        near(&stations[0], [2.5, -37.0, 1.5], [0.0, 1.0, 0.0]);
        near(
            &stations[1],
            [2.5 + 60.0 * half, 23.0 - 60.0 * half, 2.0],
            [-half, half, 0.0],
        );
        near(&stations[2], [62.5, 23.0, 2.5], [-1.0, 0.0, 0.0]);
    }

    #[test]
    fn angles_outside_the_interval_are_left_out() {
        let numbers = |from: f64, to: f64| -> Vec<u32> {
            let input = input(|input| input.trajectory.angles_of_interest_deg = [from, to]);
            input.stations().iter().map(|s| s.number).collect()
        };
        assert_eq!(numbers(300.0, 360.0), [1, 2]);
        assert_eq!(numbers(0.0, 270.0), [0]);
        assert!(numbers(0.0, 90.0).is_empty());
        let single = input(|input| {
            input.trajectory.projections = 1;
            input.trajectory.angles_of_interest_deg = [0.0, 1.0];
        });
        assert_eq!(single.stations().len(), 1);
    }

    /// The rows of the rotation to +y of MC-GPU (`rot_inv`), for beams in all quarters and out of the plane.
    #[test]
    fn columns_and_rows_are_those_of_mcgpu() {
        for direction in [
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
            [-0.6, -0.8, 0.0],
            [0.3, -0.4, 0.5],
            [-0.2, 0.1, -0.9],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ] {
            let direction = Vector3::from(direction).normalize();
            let station = Station {
                number: 0,
                angle_deg: 0.0,
                source_cm: Point3::new(1.0, 2.0, 3.0),
                direction: Unit::new_normalize(direction),
            };
            let pose = station.ct_from_device();
            let [u, v, w] = direction.into();
            let azimuth = if u.hypot(v) > 1e-4 {
                v.atan2(u)
            } else {
                90_f64.to_radians()
            };
            let (sin, cos) = azimuth.sin_cos();
            let columns = Vector3::new(sin, -cos, 0.0);
            let rows = Vector3::new(-w * cos, -w * sin, (1.0 - w * w).sqrt());
            assert!(
                (pose * Vector3::x() - columns).norm() < 1e-9,
                "{direction:?}"
            );
            assert!((pose * -Vector3::y() - rows).norm() < 1e-9, "{direction:?}");
            assert!((pose * Vector3::z() - direction).norm() < 1e-9);
            assert_eq!(pose * Point3::origin(), Point3::new(10.0, 20.0, 30.0));
        }
    }
}
