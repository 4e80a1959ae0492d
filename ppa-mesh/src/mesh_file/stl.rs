//! STL (stereolithography): triangles without shared vertices, text or binary.
//!
//! stl_io 0.11 cannot read the files of the tests: it refuses text in capitals and binary files whose header begins with
//! `solid`, accepts NaN and bytes after the last triangle, and names no line. Its writer wraps the number of triangles at 2³².

use std::collections::HashMap;
use std::io::{self, Write};

use nalgebra::Point3;

use super::MeshContents;
use super::error::Fault;
use crate::mesh::Mesh;

/// Bytes before the first triangle of a binary file: a header of any content and the number of triangles.
const HEADER: usize = 80;
const START: usize = HEADER + 4;
/// Bytes of a triangle: a normal, three corners, and two bytes without a fixed meaning.
const TRIANGLE: usize = 50;

fn broken(reason: String) -> Fault {
    Fault::Format {
        format: "STL",
        reason,
    }
}

/// Reads an STL file. A binary file is recognised by the length that its number of triangles implies,
/// since its header may begin with `solid` as text does.
pub fn read(bytes: &[u8]) -> Result<MeshContents, Fault> {
    let count = bytes.get(HEADER..START).map(|count| {
        let count = count.try_into().expect("four bytes");
        u32::from_le_bytes(count) as usize
    });
    let promised = count.and_then(|count| START.checked_add(count.checked_mul(TRIANGLE)?));
    if promised == Some(bytes.len()) {
        return Ok(binary(&bytes[START..]));
    }
    if bytes.trim_ascii_start().starts_with(b"solid") {
        return text(&String::from_utf8_lossy(bytes));
    }
    Err(broken(match (count, promised) {
        (Some(count), Some(promised)) => format!(
            "it has {} bytes, but its header specifies {promised} bytes for {count} triangles",
            bytes.len()
        ),
        _ => {
            "it is neither text that begins with \"solid\" nor long enough for a header".to_owned()
        }
    }))
}

fn binary(triangles: &[u8]) -> MeshContents {
    let mut shared = Shared::default();
    for triangle in triangles.chunks_exact(TRIANGLE) {
        let number = |at: usize| {
            let bytes = triangle[4 * at..4 * at + 4].try_into().expect("four bytes");
            f32::from_le_bytes(bytes)
        };
        shared.push([3, 6, 9].map(|at| [number(at), number(at + 1), number(at + 2)]));
    }
    shared.contents
}

fn text(text: &str) -> Result<MeshContents, Fault> {
    let mut shared = Shared::default();
    let mut corners = Vec::new();
    let mut ended = false;
    for (at, line) in text.lines().enumerate() {
        let fault = |reason: &str| broken(format!("line {}: {reason}", at + 1));
        let mut words = line.split_whitespace();
        let Some(word) = words.next() else {
            continue;
        };
        match word.to_ascii_lowercase().as_str() {
            "solid" | "outer" | "endloop" => {}
            "facet" => corners.clear(),
            "vertex" => {
                let numbers: Vec<f32> = words.map_while(|w| w.parse().ok()).collect();
                let corner = <[f32; 3]>::try_from(numbers);
                corners.push(corner.map_err(|_| fault("expected three numbers"))?);
            }
            "endfacet" => {
                let corners = <[[f32; 3]; 3]>::try_from(corners.as_slice());
                shared.push(corners.map_err(|_| fault("expected three corners before it"))?);
            }
            "endsolid" => ended = true,
            _ => return Err(fault("expected an STL keyword")),
        }
    }
    if !ended {
        return Err(broken("it ends without \"endsolid\"".to_owned()));
    }
    Ok(shared.contents)
}

/// Triangles whose corners at the same position become one vertex.
#[derive(Default)]
struct Shared {
    contents: MeshContents,
    numbers: HashMap<[u32; 3], u32>,
}

impl Shared {
    fn push(&mut self, corners: [[f32; 3]; 3]) {
        let points = &mut self.contents.cloud.points;
        let triangle = corners.map(|corner| {
            // 0 and −0 are the same position.
            let place = corner.map(|c| (c + 0.0).to_bits());
            *self.numbers.entry(place).or_insert_with(|| {
                points.push(Point3::from(corner));
                points.len() as u32 - 1
            })
        });
        self.contents.triangles.push(triangle);
    }
}

pub fn write(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let count = u32::try_from(mesh.triangles.len()).map_err(|_| io::ErrorKind::InvalidInput)?;
    out.write_all(&[0; HEADER])?;
    out.write_all(&count.to_le_bytes())?;
    for triangle in &mesh.triangles {
        let [a, b, c] = mesh.corners(triangle);
        let normal = (b - a).cross(&(c - a));
        let normal = normal.try_normalize(0.0).unwrap_or_default().cast::<f32>();
        let corners = triangle.map(|vertex| mesh.vertices[vertex as usize].coords);
        for number in [normal].iter().chain(&corners).flat_map(|v| v.iter()) {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&[0; TRIANGLE - 48])?;
    }
    Ok(())
}
