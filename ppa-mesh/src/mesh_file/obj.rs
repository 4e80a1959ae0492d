//! OBJ (Wavefront): text with one vertex, normal or face per line.
//!
//! tobj 4.0 writes no files and cannot read those of the tests: it returns no points for a cloud and drops points that no face uses,
//! refuses a vertex with weight and colour, and reports neither the line nor the index at fault.

use std::io::{self, Write};

use nalgebra::{Point3, Vector3};

use super::MeshContents;
use super::error::Fault;
use super::polygons::Polygons;
use crate::mesh::PointCloud;

fn broken(line: usize, reason: &str) -> Fault {
    Fault::Format {
        format: "OBJ",
        reason: format!("line {}: {reason}", line + 1),
    }
}

/// Reads an OBJ file. Lines other than `v`, `vn` and `f` (groups, materials, textures) do not affect the
/// shape and are skipped.
pub fn read(bytes: &[u8]) -> Result<MeshContents, Fault> {
    // Comments may be in any encoding; everything that matters here is ASCII.
    let text = String::from_utf8_lossy(bytes);
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    let mut corners: Vec<i64> = Vec::new();
    let mut ends = Vec::new();
    let mut own_normals = true;
    for (at, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => points.push(Point3::from(three(words, at)?)),
            Some("vn") => normals.push(Vector3::from(three(words, at)?)),
            Some("f") => {
                for word in words {
                    let (corner, normal) = corner(word, points.len(), normals.len())
                        .ok_or_else(|| broken(at, &format!("\"{word}\" is not a face vertex")))?;
                    own_normals &= normal.is_none_or(|normal| normal == corner);
                    corners.push(corner);
                }
                ends.push(corners.len());
            }
            _ => {}
        }
        if line.ends_with('\\') {
            return Err(broken(at, "line continuations are not supported"));
        }
    }
    let mut polygons = Polygons::between(points.len());
    let mut start = 0;
    for end in ends {
        polygons.push(&corners[start..end], |corner| corner + 1)?;
        start = end;
    }
    if !own_normals || normals.len() != points.len() {
        normals.clear();
    }
    Ok(MeshContents {
        cloud: PointCloud { points, normals },
        triangles: polygons.triangles,
    })
}

fn three<'a>(words: impl Iterator<Item = &'a str>, line: usize) -> Result<[f32; 3], Fault> {
    let mut numbers = words.map(str::parse::<f32>);
    let mut next = || match numbers.next() {
        Some(Ok(number)) => Ok(number),
        _ => Err(broken(line, "expected three numbers")),
    };
    Ok([next()?, next()?, next()?])
}

/// Vertex and normal, from 0, of `7`, `7/3`, `7//5` or `7/3/5`; negative numbers count from the end.
fn corner(word: &str, points: usize, normals: usize) -> Option<(i64, Option<i64>)> {
    let from_zero = |number: &str, count: usize| match number.parse::<i64>().ok()? {
        number if number < 0 => number.checked_add(count as i64),
        number => number.checked_sub(1),
    };
    let mut parts = word.split('/');
    let vertex = from_zero(parts.next()?, points)?;
    match parts.nth(1) {
        None | Some("") => Some((vertex, None)),
        Some(normal) => Some((vertex, Some(from_zero(normal, normals)?))),
    }
}

pub fn write(
    out: &mut dyn Write,
    points: &[Point3<f32>],
    normals: &[Vector3<f32>],
    triangles: &[[u32; 3]],
) -> io::Result<()> {
    // The shortest decimal numbers that read back as the same value.
    for p in points {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    let with_normals = normals.len() == points.len();
    for n in normals.iter().filter(|_| with_normals) {
        writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
    }
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| vertex + 1);
        if with_normals {
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        } else {
            writeln!(out, "f {a} {b} {c}")?;
        }
    }
    Ok(())
}
