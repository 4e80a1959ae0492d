//! The header of a voxel file, and the order of voxels it states.

use crate::mcgpu::error::McgpuError;
use crate::mcgpu::lines::{Lines, columns, holds, numbers};

/// Smallest number of bytes per voxel in the file: two digits, the blank between them, and a line feed.
const BYTES_PER_LINE: u64 = 4;

/// Bytes per voxel in memory: material, density, and the tables of the transport.
const BYTES_PER_VOXEL: u64 = 10;

/// Last column allowed for material and density.
const LAST_COLUMN: usize = 16;

/// The header above the voxels.
pub(super) struct VoxelHeader {
    pub size: [u64; 3],
    pub side_cm: [f64; 3],
    /// Columns of material and density, from 0.
    columns: [usize; 2],
}

impl VoxelHeader {
    pub fn read(lines: &mut Lines) -> Result<Self, McgpuError> {
        while !holds(&expect(lines, "[SECTION VOXELS HEADER")?, "[SECTION VOXELS") {}
        let expected = "the number of voxels along x, y, z";
        let line = expect(lines, expected)?;
        let size = numbers::<3>(&line)
            .filter(|size| {
                size.iter()
                    .all(|n| n.fract() == 0.0 && (1.0..=1e9).contains(n))
            })
            .ok_or_else(|| lines.unexpected(&line, expected))?
            .map(|n| n as u64);
        let expected = "the sides of a voxel in cm, 0.0001 to 1000";
        let line = expect(lines, expected)?;
        let side_cm = numbers::<3>(&line)
            .filter(|side| side.iter().all(|side| (1e-4..=1e3).contains(side)))
            .ok_or_else(|| lines.unexpected(&line, expected))?;
        let mut column = [0, 1];
        let mut index = 0;
        loop {
            let line = expect(lines, "[END OF VXH SECTION]")?;
            if holds(&line, "[END OF VXH SECTION") {
                break;
            }
            if let Some(column) = column.get_mut(index) {
                let expected = format!("a column number from 1 to {LAST_COLUMN}");
                *column = columns(&line)
                    .next()
                    .and_then(|number| number.parse().ok())
                    .filter(|number| (1..=LAST_COLUMN).contains(number))
                    .ok_or_else(|| lines.unexpected(&line, expected))?
                    - 1;
            }
            index += 1;
        }
        if column[0] == column[1] {
            let expected = "material and density in different columns";
            return Err(lines.unexpected(b"the same column for both", expected));
        }
        Ok(Self {
            size,
            side_cm,
            columns: column,
        })
    }

    /// Number of voxels, if the file and the memory can hold them.
    pub fn voxels(&self, lines: &Lines, available: u64) -> Result<usize, McgpuError> {
        // At most 10²⁷, so 128 bits do not overflow.
        let voxels: u128 = self.size.iter().map(|&n| u128::from(n)).product();
        // The last line may have no line feed.
        let most = lines.most_text_bytes().saturating_add(1) / BYTES_PER_LINE;
        if voxels > u128::from(most) {
            return Err(McgpuError::VoxelsMissing {
                path: lines.path().into(),
                size: self.size,
                bytes: lines.file_bytes(),
                most,
            });
        }
        let needed = voxels * u128::from(BYTES_PER_VOXEL);
        if needed > u128::from(available) || usize::try_from(needed).is_err() {
            return Err(McgpuError::Memory {
                path: lines.path().into(),
                size: self.size,
                needed_mb: (needed / 1_000_000) as u64,
                available_mb: available / 1_000_000,
            });
        }
        Ok(voxels as usize)
    }

    /// Parses the material number and the density in a line.
    #[inline]
    pub fn voxel(&self, line: &[u8]) -> Option<(u8, f32)> {
        let (number, density) = if self.columns == [0, 1] {
            let mut columns = columns(line);
            (columns.next()?, columns.next()?)
        } else {
            let column = |index| columns(line).nth(index);
            (column(self.columns[0])?, column(self.columns[1])?)
        };
        let number = number.parse().ok().filter(|&number: &u8| number >= 1)?;
        let density = density.parse().ok()?;
        (1e-9..=1e3).contains(&density).then_some((number, density))
    }

    pub fn expected_line(&self) -> String {
        let [material, density] = self.columns.map(|column| column + 1);
        format!(
            "a material number from 1 to 255 in column {material} and a density from 1e-9 to 1000 g/cm³ in column {density}"
        )
    }
}

/// Returns the next line, or an error at the end of the file.
fn expect(lines: &mut Lines, expected: &str) -> Result<Vec<u8>, McgpuError> {
    let line = lines.next()?.map(<[u8]>::to_vec);
    line.ok_or_else(|| lines.ends(expected))
}
