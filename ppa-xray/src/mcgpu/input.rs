//! The input file (`.in`) of MC-GPU v1.3.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Unit, Vector3};

use crate::mcgpu::error::McgpuError;
use crate::mcgpu::sections::{MaterialLine, RunLength, Trajectory, VoxelDose, all_lengths};
use crate::mcgpu::values::{NamedFile, Values};

/// Contents of an input file. Lengths are in cm, in the frame of the voxel box, whose corner with the lowest coordinates is the
/// origin.
///
/// The number of the graphics card, its threads, and the histories per thread are ignored.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// The input file.
    pub path: PathBuf,
    /// Length of the run of each projection.
    pub run_length: RunLength,
    /// Seed of the random numbers.
    pub seed: u64,
    /// The energy spectrum, `.spc`.
    pub spectrum: NamedFile,
    /// Focal spot of the first projection.
    pub source_cm: Point3<f64>,
    /// Central beam of the first projection.
    pub direction: Unit<Vector3<f64>>,
    /// Full apertures of the fan along the columns and along the rows of the detector, degrees; `None` if the field
    /// is exactly the detector.
    ///
    /// The columns come first, as in the code of MC-GPU; its comment in the file ("polar and azimuthal") is wrong.
    pub apertures_deg: Option<[f64; 2]>,
    /// Name of the image file to write.
    pub image_file: String,
    /// Pixels along the columns (across the beam in the xy plane) and the rows (along z).
    pub pixels: [u32; 2],
    /// Extent of the detector along columns and rows.
    pub detector_cm: [f64; 2],
    /// Distance from the source to the centre of the detector, along the central beam.
    pub source_detector_cm: f64,
    /// The scan.
    pub trajectory: Trajectory,
    /// Whether the energy in every material is requested.
    pub material_dose: bool,
    /// Voxels whose dose is requested.
    pub voxel_dose: Option<VoxelDose>,
    /// The geometry, penEasy `.vox` or `.vox.gz`.
    pub voxels: NamedFile,
    /// Materials; the voxels number them from 1.
    pub materials: Vec<MaterialLine>,
}

impl Input {
    /// Reads an input file. The files named in it are not read yet.
    ///
    /// Text after `#` and blank lines are ignored. Sections are in the order of MC-GPU.
    ///
    /// # Errors
    /// [`McgpuError`] naming the file, the line, what was found and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, McgpuError> {
        let path = path.as_ref();
        let mut values = Values::open(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));

        values.section("SIMULATION CONFIG", Some("v.2009-05-12"))?;
        let run_length = values.run_length()?;
        let [seed] = values.number("a seed, an integer of 0 or more", |[seed]| {
            (0.0..=9e15).contains(&seed) && seed.fract() == 0.0
        })?;
        for what in [
            "the number of the graphics card",
            "threads per block",
            "histories per thread",
        ] {
            values.number(what, |[_]: [f64; 1]| true)?;
        }

        values.section("SOURCE", Some("v.2011-07-12"))?;
        let spectrum = values.file("an energy spectrum file", folder)?;
        let source_cm = values.number("the source position x y z in cm", all_lengths)?;
        let direction = values.number(
            "the direction u v w of the beam, not the null vector",
            |direction: [f64; 3]| all_lengths(direction) && Vector3::from(direction).norm() > 1e-9,
        )?;
        let apertures = values.number(
            "two apertures below 180 degrees, or negative ones for the whole detector",
            |apertures: [f64; 2]| apertures.iter().all(|a| *a < 180.0 && a.is_finite()),
        )?;

        values.section("IMAGE DETECTOR", Some("v.2009-12-02"))?;
        let image_file = values.output_name("an image file name")?;
        let pixels = values.number("the number of pixels Nx Nz, 1 to 65536", |n: [f64; 2]| {
            n.iter()
                .all(|n| (1.0..=65_536.0).contains(n) && n.fract() == 0.0)
        })?;
        let detector_cm = values.number("the image size Dx Dz in cm", all_positive)?;
        let [source_detector_cm] =
            values.number("the source-detector distance in cm", all_positive)?;

        values.section("CT SCAN TRAJECTORY", Some("v.2011-10-25"))?;
        let trajectory = values.trajectory(direction, source_detector_cm)?;

        values.section("DOSE DEPOSITION", Some("v.2012-12-12"))?;
        let material_dose = values.yes()?;
        let voxel_dose = values.yes()?.then(|| values.voxel_dose()).transpose()?;

        values.section("VOXELIZED GEOMETRY FILE", Some("v.2009-11-30"))?;
        let voxels = values.file("a voxel geometry file", folder)?;

        values.section("MATERIAL", None)?;
        let materials = values.materials(folder)?;
        Ok(Self {
            path: path.into(),
            run_length,
            seed: seed as u64,
            spectrum,
            source_cm: Point3::from(source_cm),
            direction: Unit::new_normalize(Vector3::from(direction)),
            apertures_deg: (apertures[0] > -1e-7 && apertures[1] > -1e-7)
                .then_some(apertures.map(|aperture| aperture.max(0.0))),
            image_file,
            pixels: pixels.map(|n| n as u32),
            detector_cm,
            source_detector_cm,
            trajectory,
            material_dose,
            voxel_dose,
            voxels,
            materials,
        })
    }
}

fn all_positive<const N: usize>(lengths_cm: [f64; N]) -> bool {
    lengths_cm
        .iter()
        .all(|length| (1e-4..=1e5).contains(length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcgpu::mangled;
    use crate::mcgpu::sections::MaterialSource;

    const SAMPLE: &str = include_str!("sample.in");

    fn read(text: &[u8]) -> Result<Input, McgpuError> {
        mangled::read(text, |path| Input::read(path))
    }

    #[test]
    fn every_value_of_a_scan_is_read() {
        let file = tempfile::tempdir().unwrap();
        let path = file.path().join("scan.in");
        std::fs::write(&path, SAMPLE).unwrap();
        let input = Input::read(&path).unwrap();
        let here = |name: &str| file.path().join(name);
        assert_eq!(input.run_length, RunLength::Histories(250_000));
        assert_eq!(input.seed, 1_234_567_890);
        assert_eq!(input.spectrum.path, here("../beam.spc"));
        assert_eq!(input.spectrum.line, 11);
        assert_eq!(input.source_cm, Point3::new(2.5, -37.0, 1.5));
        assert_eq!(input.direction.into_inner(), Vector3::y());
        assert_eq!(input.apertures_deg, None);
        assert_eq!(input.image_file, "image.dat");
        assert_eq!(input.pixels, [35, 25]);
        assert_eq!(input.detector_cm, [7.0, 5.0]);
        assert_eq!(input.source_detector_cm, 90.0);
        let trajectory = Trajectory {
            projections: 3,
            step_deg: 45.0,
            angles_of_interest_deg: [0.0, 5000.0],
            source_axis_cm: 60.0,
            rise_cm: 0.5,
        };
        assert_eq!(input.trajectory, trajectory);
        assert!(input.material_dose);
        let dose = VoxelDose {
            file: "dose.dat".into(),
            first: [0, 1, 2],
            last: [9, 10, 11],
        };
        assert_eq!(input.voxel_dose, Some(dose));
        assert_eq!(input.voxels.path, here("head.vox.gz"));
        let materials: Vec<_> = input.materials.iter().map(|m| m.source.clone()).collect();
        let air = MaterialSource::File(here("../materials/air.mcgpu.gz"));
        assert_eq!(materials, [air, MaterialSource::Library("water".into())]);
    }

    #[test]
    fn a_small_number_is_a_time_and_one_projection_needs_no_scan() {
        let text = SAMPLE
            .replace("2.5e5 ", "90 ")
            .replace("-15.0 -15.0", "10.0 0.0")
            .replacen("\n3 ", "\n0 ", 1)
            .replace('\n', "\r\n");
        let input = read(text.as_bytes()).unwrap();
        assert_eq!(input.run_length, RunLength::Seconds(90.0));
        assert_eq!(input.apertures_deg, Some([10.0, 0.0]));
        assert_eq!(input.trajectory.projections, 1);
        assert_eq!(input.trajectory.source_axis_cm, 0.0);
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        for (from, to, report) in [
            (
                "2.5e5 ",
                "-1 ",
                "line 4: found \"-1\", expected the number of histories",
            ),
            ("2.5 -37.0", "2.5 nan", "line 12: found \"2.5 nan 1.5\""),
            ("0.0 1.0 0.0", "0 0 0", "line 13"),
            ("-15.0 -15.0", "200 5", "line 14"),
            (
                "35 25",
                "35",
                "line 18: found \"35\", expected the number of pixels",
            ),
            ("7.0 5.0", "7.0 0", "line 19"),
            ("\n3 ", "\n-3 ", "line 23"),
            (
                "0.0 1.0 0.0",
                "0.0 1.0 0.1",
                "line 23: found \"3\", expected 1 projection",
            ),
            ("60.0 ", "91.0 ", "line 26"),
            (
                "YES",
                "MAYBE",
                "line 30: found \"MAYBE\", expected YES or NO",
            ),
            ("2 11", "12 11", "line 34"),
            (
                "v.2012-12-12",
                "v.2011-02-18",
                "line 29: section DOSE DEPOSITION is from another version",
            ),
            (
                "#[SECTION VOXELIZED",
                "#[",
                "expected [SECTION VOXELIZED GEOMETRY FILE",
            ),
            ("90.0 ", "# ", "line 22: found \"#[SECTION CT SCAN"),
        ] {
            let found = mangled::report(SAMPLE, [from, to], |path| Input::read(path));
            assert!(found.contains(report), "{from} → {to}: {found}");
        }
        // Only the start of a line is a headline.
        let commented = SAMPLE.replace(".gz ", ".gz # CROSS SECTION data ");
        let commented = commented.replace(".gz\n", ".gz # CROSS SECTION data\n");
        assert_ne!(commented, SAMPLE);
        let materials = |text: &str| read(text.as_bytes()).unwrap().materials.len();
        assert_eq!(materials(&commented), materials(SAMPLE));
        let (before, _) = SAMPLE.split_once("../materials").unwrap();
        let found = read(before.as_bytes()).unwrap_err().to_string();
        assert!(
            found.contains("expected at least one material file"),
            "{found}"
        );
    }

    proptest::proptest! {
        /// Reading a damaged file returns an input or an error, whatever its content.
        #[test]
        fn a_damaged_file_is_read_or_refused(damage in mangled::damage()) {
            let _ = read(&mangled::damaged(SAMPLE.as_bytes(), &damage));
        }
    }
}
