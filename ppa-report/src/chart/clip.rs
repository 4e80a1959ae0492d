//! Clipping of points and lines to the axes.

/// The nearest point within the axes; a point inside is unchanged.
pub fn point(point: [f64; 2], ranges: [[f64; 2]; 2]) -> [f64; 2] {
    [0, 1].map(|axis| point[axis].clamp(ranges[axis][0], ranges[axis][1]))
}

/// The part of a segment within the axes; none if it has no such part or an end that is not finite.
///
/// Liang and Barsky 1984 (doi:10.1145/357332.357333): each side of the axes bounds the parameter from a + t (b - a).
fn segment([a, b]: [[f64; 2]; 2], ranges: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    if !a.iter().chain(&b).all(|x| x.is_finite()) {
        return None;
    }
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let way = b[axis] - a[axis];
        let [low, high] = ranges[axis].map(|end| end - a[axis]);
        if way == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (enters, leaves) = match way > 0.0 {
            true => (low / way, high / way),
            false => (high / way, low / way),
        };
        (first, last) = (first.max(enters), last.min(leaves));
    }
    let at = |t: f64| point([0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis])), ranges);
    (first <= last).then(|| [at(first), at(last)])
}

/// The parts of a polyline that are within the axes.
pub fn lines(points: &[[f64; 2]], ranges: [[f64; 2]; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    for pair in points.windows(2) {
        let Some([from, to]) = segment([pair[0], pair[1]], ranges) else {
            continue;
        };
        match lines.last_mut() {
            Some(line) if line.last() == Some(&from) => line.push(to),
            _ => lines.push(vec![from, to]),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line that leaves the axes and returns is cut in two where it crosses the rim.
    #[test]
    fn lines_are_cut_at_the_rim() {
        let points = [[0.0, 0.0], [1.0, 4.0], [2.0, 4.0], [2.0, 1.0], [1.0, 1.0]];
        let cut = lines(&points, [[0.0, 2.0], [0.0, 2.0]]);
        let second = vec![[2.0, 2.0], [2.0, 1.0], [1.0, 1.0]];
        assert_eq!(cut, [vec![[0.0, 0.0], [0.5, 2.0]], second]);
    }

    #[test]
    fn segments_by_hand() {
        let axes = [[0.0, 2.0], [0.0, 1.0]];
        let cut = |a, b| segment([a, b], axes);
        assert_eq!(cut([0.5, 0.5], [1.5, 0.5]), Some([[0.5, 0.5], [1.5, 0.5]]));
        // Through two sides, in both directions.
        assert_eq!(cut([-1.0, 0.5], [3.0, 0.5]), Some([[0.0, 0.5], [2.0, 0.5]]));
        assert_eq!(cut([1.0, 3.0], [1.0, -1.0]), Some([[1.0, 1.0], [1.0, 0.0]]));
        // Past a corner, to the side, and beyond.
        assert_eq!(cut([-1.0, 0.5], [0.5, 2.0]), None);
        assert_eq!(cut([0.0, 1.5], [2.0, 1.5]), None);
        assert_eq!(cut([3.0, 0.5], [4.0, 0.5]), None);
        assert_eq!(cut([0.5, f64::NAN], [1.5, 0.5]), None);
    }
}
