//! The camera in an OpenCV file storage (YAML), as `cv::FileStorage` and ROS write it.
//!
//! A file storage is not YAML 1.2 (its first line is `%YAML:1.0`, matrices carry a tag of their own), so the few entries that describe a camera are
//! looked up line by line.

use crate::camera::spec::CameraSpec;

/// Names under which programs store the camera matrix and the coefficients.
const MATRIX_KEYS: &[&str] = &["camera_matrix", "cameraMatrix", "K"];
const COEFFICIENT_KEYS: &[&str] = &["distortion_coefficients", "distCoeffs", "D"];

/// Names that ROS has for OpenCV's model with 5 and with 8 coefficients.
const ROS_MODELS: &[&str] = &["plumb_bob", "rational_polynomial"];

/// The camera in the text of a file storage, or what is wrong with it.
pub(crate) fn camera(text: &str) -> Result<CameraSpec, String> {
    // ROS names the model, which the number of coefficients does not distinguish from a fisheye.
    if let Some(entry) = after(text, "distortion_model") {
        let name = entry.lines().next().unwrap_or_default();
        let name = name.trim().trim_matches(['"', '\'']);
        if !ROS_MODELS.contains(&name) {
            return Err(format!(
                "its distortion_model is {name:?}, expected {}",
                ROS_MODELS.join(" or ")
            ));
        }
    }
    let matrix = matrix(text, MATRIX_KEYS)?;
    let &[fx, skew, cx, zero, fy, cy, ..] = matrix.as_slice() else {
        return Err(format!(
            "its camera matrix has {} numbers, expected 9",
            matrix.len()
        ));
    };
    if matrix.len() != 9 || [skew, zero, matrix[6], matrix[7]] != [0.0; 4] || matrix[8] != 1.0 {
        return Err(format!(
            "its camera matrix is {matrix:?}, expected [fx, 0, cx, 0, fy, cy, 0, 0, 1]"
        ));
    }
    let mut coefficients = self::matrix(text, COEFFICIENT_KEYS)?;
    if ![4, 5, 8, 12, 14].contains(&coefficients.len()) {
        return Err(format!(
            "it has {} distortion coefficients, expected 4, 5, 8, 12 or 14",
            coefficients.len()
        ));
    }
    coefficients.resize(14, 0.0);
    // OpenCV's order; thin prism and tilt follow.
    let [k1, k2, p1, p2, k3, k4, k5, k6] = std::array::from_fn(|i| coefficients[i]);
    if coefficients[8..].iter().any(|value| *value != 0.0) {
        return Err(
            "it has thin-prism or tilt coefficients, expected the rational model alone".to_owned(),
        );
    }
    Ok(CameraSpec::brown_conrady(
        [size(text, "image_width")?, size(text, "image_height")?],
        [fx, fy, cx, cy],
        [k1, k2, k3, k4, k5, k6],
        [p1, p2],
    ))
}

/// What follows `key:` at the start of a line.
fn after<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        if let Some(rest) = line.strip_prefix(key)
            && rest.trim_start().starts_with(':')
        {
            let colon = line.len() - rest.trim_start().len();
            return Some(&text[start + colon + 1..]);
        }
        start += line.len();
    }
    None
}

/// Rows, one after the other, of the matrix under one of the keys.
fn matrix(text: &str, keys: &[&str]) -> Result<Vec<f64>, String> {
    let key = keys[0];
    let entry = keys.iter().find_map(|key| after(text, key));
    let entry = entry.ok_or_else(|| format!("it has no {}", keys.join(", ")))?;
    // The entry ends where the next key starts at the first column.
    let end = entry
        .match_indices('\n')
        .find(|(at, _)| entry[at + 1..].starts_with(|c: char| c.is_alphabetic()))
        .map_or(entry.len(), |(at, _)| at);
    let numbers = entry[..end]
        .split_once('[')
        .and_then(|(_, rest)| rest.split_once(']'))
        .ok_or_else(|| format!("its {key} has no data in square brackets"))?
        .0;
    numbers
        .split(',')
        .map(str::trim)
        .filter(|number| !number.is_empty())
        .map(|number| {
            // OpenCV writes "1." and ".5", which Rust reads too.
            number
                .parse()
                .map_err(|_| format!("its {key} holds {number:?}, expected a number"))
        })
        .collect()
}

fn size(text: &str, key: &str) -> Result<u32, String> {
    let entry = after(text, key).ok_or_else(|| format!("it has no {key}"))?;
    let word = entry.lines().next().unwrap_or_default().trim();
    word.parse()
        .map_err(|_| format!("its {key} is {word:?}, expected a number of pixels"))
}
