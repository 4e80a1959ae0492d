//! Options that are lists of numbers: points, ranges, boxes.

use nalgebra::Point3;
use ppa_core::Roi;
use ppa_dataset::labels::BoneNumbers;
use ppa_mesh::{Ball, Bump, VoxelBox};

fn finite<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    let numbers = numbers.and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
    numbers.filter(|numbers| numbers.iter().all(|n| n.is_finite()))
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    finite(text).ok_or_else(|| format!("expected {N} numbers separated by commas"))
}

/// Parses `X,Y,Z`.
pub fn point(text: &str) -> Result<[f64; 3], String> {
    numbers(text)
}

/// Parses `X,Y,Z,HEIGHT,SIGMA`: a bump and its position, mm.
pub fn bump(text: &str) -> Result<Bump, String> {
    let [x, y, z, height_mm, sigma_mm] = numbers(text)?;
    Ok(Bump {
        centre: Point3::new(x, y, z),
        height_mm,
        sigma_mm,
    })
}

/// Parses `X,Y,Z,RADIUS`, mm.
pub fn ball(text: &str) -> Result<Ball, String> {
    let [x, y, z, radius_mm] = numbers(text)?;
    Ok(Ball {
        centre_mm: [x, y, z],
        radius_mm,
    })
}

/// Parses `FROM,TO`.
pub fn range(text: &str) -> Result<[f64; 2], String> {
    numbers(text)
}

/// Parses one number for all three axes, or three.
pub fn along_axes(text: &str) -> Result<[f64; 3], String> {
    finite::<1>(text)
        .map(|[number]| [number; 3])
        .or_else(|| finite(text))
        .ok_or_else(|| "expected one number, or three separated by commas".to_owned())
}

/// Parses `FROM,TO` along x, y and z into the smallest and the largest corner.
pub fn world_box(text: &str) -> Result<[[f64; 3]; 2], String> {
    let [x0, x1, y0, y1, z0, z1] = numbers(text)?;
    let corners = [[x0, y0, z0], [x1, y1, z1]];
    if (0..3).any(|axis| corners[0][axis] >= corners[1][axis]) {
        return Err("expected each range to end above its start".to_owned());
    }
    Ok(corners)
}

/// Parses `X,Y,SIZE`: first column, first row, and side of a square, in pixels.
pub fn square(text: &str) -> Result<Roi, String> {
    let numbers: Option<Vec<u32>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    match numbers.as_deref() {
        Some(&[x, y, size]) if size > 0 => Ok(Roi {
            x_start: x,
            y_start: y,
            size,
        }),
        _ => Err("expected three whole numbers separated by commas, the last above 0".to_owned()),
    }
}

/// Parses first and one past the last index along i, j and k.
pub fn voxel_box(text: &str) -> Result<VoxelBox, String> {
    let numbers: Option<Vec<usize>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    match numbers.as_deref() {
        Some(&[i0, i1, j0, j1, k0, k1]) => Ok(VoxelBox {
            low: [i0, j0, k0],
            high: [i1, j1, k1],
        }),
        _ => Err("expected 6 voxel indices separated by commas".to_owned()),
    }
}

/// Parses `TIBIA,FIBULA,TALUS`: three labels of bones.
pub fn bone_numbers(text: &str) -> Result<BoneNumbers, String> {
    let numbers: Option<Vec<u8>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|&label| label > 0))
        .collect();
    match numbers.as_deref() {
        Some(&[tibia, fibula, talus]) if tibia != fibula && fibula != talus && talus != tibia => {
            Ok(BoneNumbers {
                tibia,
                fibula,
                talus,
            })
        }
        _ => Err("expected three different numbers from 1 to 255, separated by commas".to_owned()),
    }
}
