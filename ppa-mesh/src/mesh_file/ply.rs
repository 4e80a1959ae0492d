//! PLY (Stanford): text and both binary orders in, binary little endian out.

use std::io::{self, BufRead, Write};

use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    Addable, DefaultElement, ElementDef, Encoding, Header, Property, PropertyAccess,
    PropertyAccessResult, PropertyDef, PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;

use super::MeshContents;
use super::error::Fault;
use super::polygons::Polygons;
use crate::mesh::PointCloud;

const POSITION: [&str; 3] = ["x", "y", "z"];
const NORMAL: [&str; 3] = ["nx", "ny", "nz"];

#[derive(Default)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(value) = value.to_f32_lossy() else {
            return PropertyAccessResult::Ignored;
        };
        for (names, target) in [(POSITION, &mut self.position), (NORMAL, &mut self.normal)] {
            if let Some(axis) = names.iter().position(|n| *n == name) {
                target[axis] = value;
                return PropertyAccessResult::Set;
            }
        }
        PropertyAccessResult::Ignored
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        let found = |names: [&str; 3]| names.iter().position(|n| *n == name);
        let position = found(POSITION).map(|axis| self.position[axis]);
        position.or_else(|| found(NORMAL).map(|axis| self.normal[axis]))
    }
}

/// A face as it is read.
#[derive(Default)]
struct Face {
    corners: Vec<i64>,
    /// Whether its corners are not integers.
    unreadable: bool,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        // Both names are in use; the plural is the older one.
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        fn whole<T: Into<i64>>(list: Vec<T>) -> Vec<i64> {
            list.into_iter().map(Into::into).collect()
        }
        self.corners = match value {
            Property::ListChar(list) => whole(list),
            Property::ListUChar(list) => whole(list),
            Property::ListShort(list) => whole(list),
            Property::ListUShort(list) => whole(list),
            Property::ListInt(list) => whole(list),
            Property::ListUInt(list) => whole(list),
            _ => {
                self.unreadable = true;
                return PropertyAccessResult::Ignored;
            }
        };
        PropertyAccessResult::Set
    }
}

/// A face as it is written.
#[derive(Default)]
struct Triangle([u32; 3]);

impl PropertyAccess for Triangle {
    fn new() -> Self {
        Self::default()
    }

    fn get_list_uint(&self, name: &str) -> Option<&[u32]> {
        (name == "vertex_indices").then_some(&self.0)
    }
}

pub fn write(
    out: &mut dyn Write,
    points: &[Point3<f32>],
    normals: &[Vector3<f32>],
    triangles: Option<&[[u32; 3]]>,
) -> io::Result<()> {
    let with_normals = normals.len() == points.len();
    let vertices: Vec<Vertex> = points
        .iter()
        .enumerate()
        .map(|(at, point)| Vertex {
            position: point.coords.into(),
            normal: if with_normals {
                normals[at].into()
            } else {
                [0.0; 3]
            },
        })
        .collect();
    let faces: Vec<Triangle> = triangles
        .unwrap_or_default()
        .iter()
        .map(|triangle| Triangle(*triangle))
        .collect();

    let mut header = Header::new();
    header.encoding = Encoding::BinaryLittleEndian;
    let mut vertex = ElementDef::new("vertex".to_owned());
    vertex.count = vertices.len();
    let names = POSITION
        .iter()
        .chain(NORMAL.iter().filter(|_| with_normals));
    for name in names {
        let kind = PropertyType::Scalar(ScalarType::Float);
        vertex
            .properties
            .add(PropertyDef::new((*name).to_owned(), kind));
    }
    let mut face = ElementDef::new("face".to_owned());
    face.count = faces.len();
    face.properties.add(PropertyDef::new(
        "vertex_indices".to_owned(),
        PropertyType::List(ScalarType::UChar, ScalarType::UInt),
    ));
    header.elements.add(vertex.clone());
    if triangles.is_some() {
        header.elements.add(face.clone());
    }

    let mut out = out;
    let vertex_writer = Writer::<Vertex>::new();
    vertex_writer.write_header(&mut out, &header)?;
    vertex_writer.write_payload_of_element(&mut out, &vertices, &vertex, &header)?;
    if triangles.is_some() {
        Writer::<Triangle>::new().write_payload_of_element(&mut out, &faces, &face, &header)?;
    }
    Ok(())
}

/// Reads a PLY file. Other elements and properties (colours, quality) are skipped.
pub fn read(file: impl BufRead) -> Result<MeshContents, Fault> {
    // The first line of the parser's error gives the position, one of the others the cause.
    let broken = |error: ParseError| {
        let text = error.to_string();
        let cause = |line: &&str| line.trim_start().starts_with("Error:");
        let lines = text
            .lines()
            .take(1)
            .chain(text.lines().skip(1).filter(cause));
        let lines: Vec<&str> = lines.map(str::trim).collect();
        Fault::Format {
            format: "PLY",
            reason: lines.join(" "),
        }
    };
    let mut reader = Reader::new(file);
    let header = Parser::<Vertex>::new()
        .read_header(&mut reader)
        .map_err(broken)?;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let mut with_normals = false;
    for element in header.elements.values() {
        let has = |names: [&str; 3]| names.iter().all(|n| element.properties.contains_key(*n));
        if element.name == "vertex" && has(POSITION) {
            vertices = Parser::<Vertex>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(broken)?;
            with_normals = has(NORMAL);
        } else if element.name == "face" {
            faces = Parser::<Face>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(broken)?;
        } else {
            Parser::<DefaultElement>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(broken)?;
        }
    }
    let mut polygons = Polygons::between(vertices.len());
    for (at, face) in faces.iter().enumerate() {
        if face.unreadable {
            return Err(Fault::Format {
                format: "PLY",
                reason: format!("the corners of face {at} are not whole numbers"),
            });
        }
        polygons.push(&face.corners, |corner| corner)?;
    }
    let normals = vertices.iter().map(|v: &Vertex| v.normal.into());
    let cloud = PointCloud {
        points: vertices.iter().map(|v| Point3::from(v.position)).collect(),
        normals: normals
            .take(if with_normals { vertices.len() } else { 0 })
            .collect(),
    };
    Ok(MeshContents {
        cloud,
        triangles: polygons.triangles,
    })
}
