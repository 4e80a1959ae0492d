//! Voxel geometries in the text layout of penEasy 2008 (`.vox`, `.vox.gz`).

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use ppa_ct::Grid;

use crate::matter::material::Material;
use crate::mcgpu::error::McgpuError;
use crate::mcgpu::lines::Lines;
use crate::mcgpu::voxel_header::VoxelHeader;
use crate::phantom::voxels::{PhantomError, VoxelPhantom};

/// Material number and density of every voxel of a box whose corner with the lowest coordinates is the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelFile {
    /// The file.
    pub path: PathBuf,
    /// Voxels along x, y, z.
    pub size: [usize; 3],
    /// Sides of a voxel, cm.
    pub side_cm: [f64; 3],
    /// Material number, from 1; x runs fastest, then y, then z.
    pub material: Vec<u8>,
    /// Density, g/cm³, in the same order.
    pub density_g_cm3: Vec<f32>,
}

impl VoxelFile {
    /// Reads a voxel file, one line per voxel. Empty lines and lines that begin with `#` are skipped.
    ///
    /// The header gives the columns of material and density; MC-GPU always uses the first two.
    ///
    /// # Errors
    /// [`McgpuError`] for an invalid header or voxel, for more or fewer voxels than the header specifies, and
    /// for a volume that does not fit into memory. No memory is allocated before the length of the file is checked.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, McgpuError> {
        Self::read_into(path.as_ref(), available_bytes())
    }

    fn read_into(path: &Path, available: u64) -> Result<Self, McgpuError> {
        let mut lines = Lines::open(path)?;
        let header = VoxelHeader::read(&mut lines)?;
        let voxels = header.voxels(&lines, available)?;
        let mut material = Vec::with_capacity(voxels);
        let mut density_g_cm3 = Vec::with_capacity(voxels);
        while let Some(line) = lines.next()? {
            if says_nothing(line) {
                continue;
            }
            if material.len() == voxels {
                let line = line.to_vec();
                let expected = format!("nothing after the {voxels} voxels of the header");
                return Err(lines.unexpected(&line, expected));
            }
            let Some((number, density)) = header.voxel(line) else {
                let line = line.to_vec();
                return Err(lines.unexpected(&line, header.expected_line()));
            };
            material.push(number);
            density_g_cm3.push(density);
        }
        if material.len() < voxels {
            let found = material.len();
            return Err(lines.ends(format!("{voxels} voxels, found {found}")));
        }
        Ok(Self {
            path: path.into(),
            size: header.size.map(|n| n as usize),
            side_cm: header.side_cm,
            material,
            density_g_cm3,
        })
    }

    /// Materials in use, from 0, in ascending order.
    pub fn materials(&self) -> Vec<u8> {
        let mut occurs = [false; 256];
        for &number in &self.material {
            occurs[usize::from(number)] = true;
        }
        (1..=255)
            .filter(|&number| occurs[usize::from(number)])
            .map(|number| number - 1)
            .collect()
    }

    /// Converts the geometry to a phantom with the materials of [`VoxelFile::materials`], in that order. Axes and origin are kept;
    /// lengths are converted to mm.
    ///
    /// # Errors
    /// [`PhantomError`] if materials are missing.
    pub fn into_phantom(self, materials: Vec<Material>) -> Result<VoxelPhantom, PhantomError> {
        let mut place = [0; 256];
        for (index, &number) in self.materials().iter().enumerate() {
            place[usize::from(number) + 1] = index as u8;
        }
        let side_mm = Vector3::from(self.side_cm) * 10.0;
        let first_centre = Point3::from(side_mm * 0.5);
        let grid = Grid::axis_aligned(self.size, side_mm, first_centre)
            .expect("the sides are positive and no axis is empty");
        let mut material = self.material;
        for number in &mut material {
            *number = place[usize::from(*number)];
        }
        VoxelPhantom::new(grid, material, self.density_g_cm3, materials)
    }
}

#[inline]
fn says_nothing(line: &[u8]) -> bool {
    match line.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(first) => *first == b'#',
        None => true,
    }
}

/// Memory available without swapping, as reported by the system; 16 GB if unknown.
fn available_bytes() -> u64 {
    let said = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| {
            let line = text
                .lines()
                .find_map(|line| line.strip_prefix("MemAvailable:"))?;
            let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
            kilobytes.checked_mul(1_024)
        });
    said.unwrap_or(16_000_000_000)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::mcgpu::mangled;

    const SAMPLE: &str = "a box\n[SECTION VOXELS HEADER v.2008-04-13]\n3 2 2   No. OF VOXELS IN X,Y,Z\n\
        0.1 0.2 0.4   VOXEL SIZE (cm) ALONG X,Y,Z\n 1   COLUMN NUMBER WHERE MATERIAL ID IS LOCATED\n\
        2   COLUMN NUMBER WHERE THE MASS DENSITY IS LOCATED\n 1   BLANK LINES AT END OF X,Y-CYCLES (1=YES,0=NO)\n\
        [END OF VXH SECTION]\n1 0.0012\n1 1.2E-3\n 2 1.06 left over\n\n1 0.0012\n2\t1.\n2 1\n\n# z\n\n1 .001\n\
        1 1\n1 1\n\n1 1\n3 4.5\n255 1";

    fn read(text: &[u8]) -> Result<VoxelFile, McgpuError> {
        mangled::read(text, |path| VoxelFile::read_into(path, 1_000_000))
    }

    #[test]
    fn voxels_are_read_x_first_past_blanks_and_comments() {
        let file = read(SAMPLE.as_bytes()).unwrap();
        assert_eq!(file.size, [3, 2, 2]);
        assert_eq!(file.side_cm, [0.1, 0.2, 0.4]);
        assert_eq!(file.material, [1, 1, 2, 1, 2, 2, 1, 1, 1, 1, 3, 255]);
        let densities = [
            0.0012, 0.0012, 1.06, 0.0012, 1.0, 1.0, 0.001, 1.0, 1.0, 1.0, 4.5, 1.0,
        ];
        assert_eq!(file.density_g_cm3, densities);
        assert_eq!(file.materials(), [0, 1, 2, 254]);
        assert_eq!(
            read(SAMPLE.replace('\n', "\r\n").as_bytes())
                .unwrap()
                .material,
            file.material
        );
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(SAMPLE.as_bytes()).unwrap();
        assert_eq!(
            read(&gzip.finish().unwrap()).unwrap().material,
            file.material
        );
    }

    #[test]
    fn the_box_begins_at_the_origin_and_keeps_its_axes() {
        let file = read(SAMPLE.as_bytes()).unwrap();
        let materials =
            ["air", "water", "titanium", "pmma"].map(|name| Material::named(name).unwrap());
        let phantom = file.into_phantom(materials.to_vec()).unwrap();
        assert_eq!(phantom.material(), [0, 0, 1, 0, 1, 1, 0, 0, 0, 0, 2, 3]);
        let corners = phantom.corners_ct();
        assert!(corners[0].coords.norm() < 1e-12);
        assert!((corners[7] - Point3::new(3.0, 4.0, 8.0)).norm() < 1e-12);
        assert_eq!(phantom.density_g_cm3()[2], 1.06);
    }

    #[test]
    fn columns_are_those_of_the_header() {
        let text = SAMPLE
            .replace(" 1   COLUMN", "3 C")
            .replace("2   COLUMN", "1 C");
        let (header, _) = text.split_once("1 0.0012").unwrap();
        let text = format!("{header}{}", "1.5 x 7\n".repeat(12));
        let file = read(text.as_bytes()).unwrap();
        assert_eq!((file.material[0], file.density_g_cm3[11]), (7, 1.5));
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        for (from, to, expected) in [
            ("3 2 2", "3 2 0", "line 3: found \"3 2 0"),
            (
                "3 2 2",
                "3 2 3",
                "ends after line 25, expected 18 voxels, found 12",
            ),
            (
                "3 2 2",
                "3 2 1",
                "line 19: found \"1 .001\", expected nothing after the 6 voxels",
            ),
            ("3 2 2", "1e9 1e9 1e9", "voxels, but"),
            ("0.2", "-0.2", "line 4"),
            ("0.2", "NaN", "line 4"),
            ("2   COLUMN", "0 COLUMN", "line 6"),
            (
                "2   COLUMN",
                "1 COLUMN",
                "expected material and density in different columns",
            ),
            (
                "1.06",
                "nan",
                "line 11: found \"2 nan left over\", expected a material number",
            ),
            ("1.06", "0", "line 11"),
            ("3 4.5", "0 4.5", "line 24"),
            ("3 4.5", "256 4.5", "line 24"),
            ("3 4.5", "3", "line 24: found \"3\""),
            ("[END", "", "expected [END OF VXH SECTION]"),
            ("[SECTION", "", "expected [SECTION VOXELS HEADER"),
        ] {
            let found = mangled::report(SAMPLE, [from, to], |path| {
                VoxelFile::read_into(path, 1_000_000)
            });
            assert!(found.contains(expected), "{from} → {to}: {found}");
        }
    }

    #[test]
    fn a_volume_beyond_file_or_memory_is_refused_before_it_is_read() {
        let (header, _) = SAMPLE.split_once("1 0.0012").unwrap();
        let huge = header.replacen("3 2 2", "2000 2000 2500", 1);
        let found = read(huge.as_bytes()).unwrap_err().to_string();
        assert!(found.contains("2000 x 2000 x 2500 voxels, but "), "{found}");
        let text = header.replacen("3 2 2", "50 50 50", 1) + &"1 1\n".repeat(125_000);
        assert!(mangled::read(text.as_bytes(), |path| VoxelFile::read_into(path, 1 << 30)).is_ok());
        let found = read(text.as_bytes()).unwrap_err().to_string();
        let expected = "50 x 50 x 50 voxels need at least 1 MB of memory, but 1 MB are available";
        assert!(found.contains(expected), "{found}");
    }

    #[test]
    fn a_broken_gzip_stream_is_refused() {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(SAMPLE.as_bytes()).unwrap();
        let whole = gzip.finish().unwrap();
        let cut = &whole[..whole.len() - 12];
        assert!(matches!(read(cut).unwrap_err(), McgpuError::Read { .. }));
        let missing = VoxelFile::read("/nowhere/head.vox").unwrap_err();
        assert_eq!(missing.to_string(), "cannot read /nowhere/head.vox");
    }

    proptest::proptest! {
        /// Reading a damaged file returns voxels or an error, whatever its content.
        #[test]
        fn a_damaged_file_is_read_or_refused(damage in mangled::damage()) {
            let _ = read(&mangled::damaged(SAMPLE.as_bytes(), &damage));
        }
    }
}
