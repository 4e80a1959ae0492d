//! Position and orientation of the voxels from an NRRD header.

use nalgebra::{Affine3, Matrix4, Vector3, Vector4};

use super::header::Header;

/// Position and orientation of a volume, as far as its header states them.
pub(super) struct Place {
    pub(super) ct_from_voxel: Affine3<f64>,
    /// Warning about what the header does not state.
    pub(super) doubt: Option<String>,
}

const NO_POSITION: &str = "the header gives no position: the first voxel is put at the origin";

impl Place {
    pub(super) fn of(header: &Header) -> Result<Self, String> {
        let lps_from_space = axes_to_lps(header)?;
        let directions = header.get("spacedirections");
        let (mut columns, mm) = match directions {
            Some(text) => (
                vectors(text, 3, "space directions")?,
                unit_mm(header.get("spaceunits"), "space units")?,
            ),
            None => (spacings(header)?, unit_mm(header.get("units"), "units")?),
        };
        let origin = header.get("spaceorigin");
        match origin {
            Some(text) => columns.extend(vectors(text, 1, "space origin")?),
            None => columns.push(Vector3::zeros()),
        }
        let signs = lps_from_space.unwrap_or(Vector4::repeat(1.0));
        let doubt = match (lps_from_space, directions, origin) {
            (Some(_), Some(_), Some(_)) => None,
            (Some(_), Some(_), None) => Some(NO_POSITION.to_owned()),
            _ => Some(no_orientation(signs)),
        };
        let flip = Matrix4::from_diagonal(&signs);
        let mut matrix = Matrix4::identity();
        for (column, vector) in columns.iter().enumerate() {
            matrix
                .fixed_view_mut::<3, 1>(0, column)
                .copy_from(&(vector * mm));
        }
        Ok(Self {
            ct_from_voxel: Affine3::from_matrix_unchecked(flip * matrix),
            doubt,
        })
    }
}

fn no_orientation(lps_from_space: Vector4<f64>) -> String {
    let x = if lps_from_space.x < 0.0 {
        "right"
    } else {
        "left"
    };
    let y = if lps_from_space.y < 0.0 {
        "anterior"
    } else {
        "posterior"
    };
    format!(
        "the header does not say how its axes lie in the patient: they are assumed to run to the {x}, {y} and \
         superior, so left and right may be swapped"
    )
}

/// Signs that convert the axes of the header's space to LPS; `None` if no space is stated.
fn axes_to_lps(header: &Header) -> Result<Option<Vector4<f64>>, String> {
    let Some(space) = header.get("space") else {
        return Ok(None);
    };
    let (x, y) = match space.to_ascii_lowercase().as_str() {
        "left-posterior-superior" | "lps" => (1.0, 1.0),
        "right-anterior-superior" | "ras" => (-1.0, -1.0),
        "left-anterior-superior" | "las" => (1.0, -1.0),
        _ => {
            return Err(format!(
                "space {space}, expected left-posterior-superior, right-anterior-superior or left-anterior-superior"
            ));
        }
    };
    Ok(Some(Vector4::new(x, y, 1.0, 1.0)))
}

/// Axes i, j, k from bare spacings.
fn spacings(header: &Header) -> Result<Vec<Vector3<f64>>, String> {
    let text = header
        .get("spacings")
        .ok_or("the header lacks `space directions` and `spacings`")?;
    let numbers = text.split_whitespace().map(|n| n.parse().ok());
    match numbers.collect::<Option<Vec<f64>>>().as_deref() {
        Some(&[x, y, z]) if x > 0.0 && y > 0.0 && z > 0.0 => {
            Ok(vec![Vector3::x() * x, Vector3::y() * y, Vector3::z() * z])
        }
        _ => Err(format!("spacings {text}, expected three positive numbers")),
    }
}

/// Parses `count` vectors of three numbers: `(a,b,c) (d,e,f)`.
fn vectors(text: &str, count: usize, field: &str) -> Result<Vec<Vector3<f64>>, String> {
    let wrong = || format!("{field} {text}, expected {count} x (number, number, number)");
    let mut found = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        let (vector, behind) = rest
            .strip_prefix('(')
            .and_then(|r| r.split_once(')'))
            .ok_or_else(wrong)?;
        let numbers = vector.split(',').map(|n| n.trim().parse::<f64>().ok());
        let numbers = numbers.collect::<Option<Vec<_>>>().ok_or_else(wrong)?;
        let [x, y, z] = <[f64; 3]>::try_from(numbers).map_err(|_| wrong())?;
        found.push(Vector3::new(x, y, z));
        rest = behind.trim_start();
    }
    if found.len() == count {
        Ok(found)
    } else {
        Err(wrong())
    }
}

/// Millimetres per unit of length, which must be the same for all three axes.
fn unit_mm(units: Option<&str>, field: &str) -> Result<f64, String> {
    let Some(units) = units else {
        return Ok(1.0);
    };
    let mut each = units.split_whitespace().map(|unit| unit.trim_matches('"'));
    let first = each.next().unwrap_or("");
    let scale = match first {
        "mm" | "" => Some(1.0),
        "um" | "µm" => Some(1e-3),
        "cm" => Some(10.0),
        "m" => Some(1000.0),
        _ => None,
    };
    match scale {
        Some(scale) if each.all(|unit| unit == first) => Ok(scale),
        _ => Err(format!(
            "{field} {units}, expected one unit of length for all axes"
        )),
    }
}
