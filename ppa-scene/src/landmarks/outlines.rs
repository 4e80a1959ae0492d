//! Sets of pixels: components, holes, and narrow places.

/// A pixel (u, v).
pub(crate) type Pixel = (usize, usize);

/// Returns the pixels (u, v) connected to `start`. `take` returns whether a pixel is part of the set, and true at most once per
/// pixel.
pub(crate) fn flood(
    start: usize,
    (nu, nv): (usize, usize),
    diagonals: bool,
    mut take: impl FnMut(usize) -> bool,
) -> Vec<Pixel> {
    let mut pixels = Vec::new();
    let mut front = Vec::new();
    if take(start) {
        front.push(start);
    }
    while let Some(p) = front.pop() {
        let (u, v) = (p % nu, p / nu);
        pixels.push((u, v));
        for near_v in v.saturating_sub(1)..=(v + 1).min(nv - 1) {
            for near_u in u.saturating_sub(1)..=(u + 1).min(nu - 1) {
                if (diagonals || near_u == u || near_v == v) && take(near_u + nu * near_v) {
                    front.push(near_u + nu * near_v);
                }
            }
        }
    }
    pixels
}

/// A set of pixels together with the holes it encloses.
pub(crate) fn filled(pixels: &[Pixel]) -> Vec<Pixel> {
    let bounds = |pick: fn(&Pixel) -> usize| {
        let low = pixels.iter().map(pick).min().unwrap_or(0);
        let high = pixels.iter().map(pick).max().unwrap_or(0);
        (low, high - low + 1)
    };
    let ((u0, width), (v0, height)) = (bounds(|p| p.0), bounds(|p| p.1));
    // A frame of one pixel around the bounding box joins everything outside.
    let (w, h) = (width + 2, height + 2);
    let mut free = vec![true; w * h];
    for (u, v) in pixels {
        free[u - u0 + 1 + w * (v - v0 + 1)] = false;
    }
    let outside = flood(0, (w, h), false, |p| std::mem::take(&mut free[p]));
    let mut inside = vec![true; w * h];
    for (u, v) in outside {
        inside[u + w * v] = false;
    }
    (0..w * h)
        .filter(|p| inside[*p])
        .map(|p| (p % w + u0 - 1, p / w + v0 - 1))
        .collect()
}

/// The parts of a filled set that are joined by necks narrower than `2 · reach_mm`; the set itself if
/// there are none.
///
/// Pixels farther than `reach_mm` from the outside form separate pieces there; each piece, grown back, is
/// a part. `pixel_mm` are the sides of a pixel.
pub(crate) fn parts(pixels: Vec<Pixel>, pixel_mm: [f64; 2], reach_mm: f64) -> Vec<Vec<Pixel>> {
    let bound = |pick: fn(&Pixel) -> usize| pixels.iter().map(pick).max().unwrap_or(0) + 1;
    let (nu, nv) = (bound(|p| p.0), bound(|p| p.1));
    let [reach_u, reach_v] = pixel_mm.map(|side| (reach_mm / side) as isize);
    let near: Vec<(isize, isize)> = (-reach_v..=reach_v)
        .flat_map(|dv| (-reach_u..=reach_u).map(move |du| (du, dv)))
        .filter(|(du, dv)| {
            let (x, y) = (*du as f64 * pixel_mm[0], *dv as f64 * pixel_mm[1]);
            x.hypot(y) <= reach_mm
        })
        .collect();
    let around = |(u, v): Pixel| {
        near.iter().map(move |(du, dv)| {
            let (u, v) = (u as isize + du, v as isize + dv);
            ((0..nu as isize).contains(&u) && (0..nv as isize).contains(&v))
                .then(|| u as usize + nu * v as usize)
        })
    };
    let mut inside = vec![false; nu * nv];
    for (u, v) in &pixels {
        inside[u + nu * v] = true;
    }
    let mut core = vec![false; nu * nv];
    for p in &pixels {
        core[p.0 + nu * p.1] = around(*p).all(|near| near.is_some_and(|near| inside[near]));
    }
    let mut parts = Vec::new();
    for start in 0..core.len() {
        if !core[start] {
            continue;
        }
        let piece = flood(start, (nu, nv), true, |p| std::mem::take(&mut core[p]));
        let mut part: Vec<usize> = piece.into_iter().flat_map(around).flatten().collect();
        part.sort_unstable();
        part.dedup();
        parts.push(part.into_iter().map(|p| (p % nu, p / nu)).collect());
    }
    if parts.len() < 2 { vec![pixels] } else { parts }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(centre: Pixel, radius: f64) -> impl Iterator<Item = Pixel> {
        (0..60)
            .flat_map(move |v| (0..60).map(move |u| (u, v)))
            .filter(move |(u, v)| {
                let d = [u, v].map(|c| *c as f64);
                (d[0] - centre.0 as f64).hypot(d[1] - centre.1 as f64) <= radius
            })
    }

    /// Two discs that touch over three pixels come apart, a single one and one with a dent do not.
    #[test]
    fn discs_that_touch_are_two() {
        let (large, small) = ((20, 20), (38, 20));
        let mut pixels: Vec<Pixel> = disc(large, 12.0).chain(disc(small, 6.0)).collect();
        pixels.sort_unstable();
        pixels.dedup();
        let found = parts(pixels, [1.0, 1.0], 3.0);
        let mut sizes: Vec<usize> = found.iter().map(Vec::len).collect();
        sizes.sort_unstable();
        let expected = [disc(small, 6.0).count(), disc(large, 12.0).count()];
        for (found, expected) in sizes.iter().zip(expected) {
            assert!(
                found.abs_diff(expected) * 10 < expected,
                "{sizes:?} {expected:?}"
            );
        }
        assert_eq!(sizes.len(), 2);
        let one: Vec<Pixel> = disc(large, 12.0).collect();
        assert_eq!(parts(one.clone(), [1.0, 1.0], 3.0), [one]);
        let thin = vec![(1, 1), (2, 1)];
        assert_eq!(parts(thin.clone(), [1.0, 1.0], 3.0), [thin]);
    }
}
