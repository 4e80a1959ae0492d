//! The limb in the six real scans of limbs.

use std::ops::Range;

use ppa_ct::{Grid, Volume};
use ppa_mesh::{Limb, LimbSettings, extract_limb};

use crate::fields::shared;
use crate::walls::check_closed;

struct Scan {
    /// Folder and file.
    name: &'static str,
    /// Faces that cut the limb (data README).
    faces: &'static [&'static str],
    /// Bounds of the limb's volume, litres.
    litres: [f64; 2],
    /// Slices in which another limb does not touch it.
    free: Range<usize>,
    /// Slice, row and, read by eye from a picture of the slice, the column where the limb ends at
    /// the other one.
    ends: &'static [[usize; 3]],
}

const SCANS: [Scan; 6] = [
    Scan {
        name: "lower-leg-ankle-sts049/dicom",
        faces: &["-j", "-k", "+k"],
        litres: [3.0, 3.2],
        free: 0..84,
        ends: &[[90, 108, 162], [91, 108, 162]],
    },
    Scan {
        name: "knee-calf-sts028/CT_image.nii.gz",
        faces: &["-j", "-k", "+k"],
        litres: [2.4, 2.5],
        free: 0..60,
        ends: &[],
    },
    Scan {
        name: "calf-couch-sts025/CT_image.nii.gz",
        faces: &["-j", "-k", "+k"],
        litres: [1.0, 1.1],
        free: 0..47,
        ends: &[],
    },
    Scan {
        name: "two-calves-sts032/CT_image.nii.gz",
        faces: &["-i", "-k", "+k"],
        litres: [1.5, 1.6],
        free: 32..54,
        ends: &[[25, 80, 116], [26, 80, 117], [27, 80, 117]],
    },
    Scan {
        name: "knee-sts042/CT_image.nii.gz",
        faces: &["-i", "+j", "-k", "+k"],
        litres: [1.45, 1.55],
        free: 0..49,
        ends: &[],
    },
    Scan {
        name: "wrist-hand-sts019/CT_image.nii.gz",
        faces: &["-i", "+i", "-j", "-k", "+k"],
        litres: [0.62, 0.63],
        free: 0..23,
        ends: &[
            [25, 56, 106],
            [27, 62, 110],
            [29, 72, 114],
            [30, 78, 115],
            [32, 86, 116],
            [34, 90, 120],
        ],
    },
];

/// Denser than couch and cloth, which stay below it in these scans, but not than fat.
const SKIN_HU: f32 = -200.0;
/// The limb's border may lie this far outside that of the denser tissue, voxels.
const BORDER: usize = 1;

#[test]
#[ignore = "needs ../shared/data"]
fn six_limbs_lose_couch_sheet_and_neighbour() {
    for scan in SCANS {
        let path = shared().join("data").join(scan.name);
        let volume = ppa_ct::read(&path).expect("scan").volume;
        let limb = extract_limb(&volume, &LimbSettings::default()).expect("limb");
        let report = &limb.report;
        let cut: Vec<&str> = report
            .cut_faces
            .iter()
            .map(|cut| cut.face.as_str())
            .collect();
        assert_eq!(cut, scan.faces, "{}", scan.name);
        let found = report.limb_mm3 * 1e-6;
        let within = (scan.litres[0]..scan.litres[1]).contains(&found);
        assert!(within, "{}: {found} litres", scan.name);
        assert_eq!(limb.mesh.components(), 1, "{}", scan.name);
        check_closed(volume.grid(), &limb, scan.name);

        // In one slice at a time, without couch finding, erosion or watershed: the dense tissue that
        // is connected is limb, and the limb hardly extends beyond it.
        let (mut dense, mut lost, mut gained) = (0, 0, 0);
        for k in scan.free.clone() {
            let tissue = dense_tissue(&volume, &limb, k);
            let near = widened(volume.grid(), &tissue, BORDER);
            let inside = slice(volume.grid(), &limb.mask, k);
            for ((&tissue, &near), &inside) in tissue.iter().zip(&near).zip(inside) {
                dense += usize::from(tissue);
                lost += usize::from(tissue && !inside);
                gained += usize::from(inside && !near);
            }
        }
        assert_eq!(lost, 0, "{}: of {dense} voxels", scan.name);
        assert!(
            1000 * gained < 3 * dense,
            "{}: {gained} beside {dense} voxels",
            scan.name
        );

        // Marrow, joints and air in the flesh are not seen: no vertex is far from the open.
        let open: Vec<Vec<bool>> = (0..volume.grid().size()[2])
            .map(|k| widened(volume.grid(), &outside(&volume, k), 1 + BORDER))
            .collect();
        let voxel_from_ct = volume.grid().voxel_from_ct();
        for vertex in &limb.mesh.vertices {
            let voxel = voxel_from_ct * vertex.cast::<f64>();
            let [i, j, k] = [voxel.x, voxel.y, voxel.z].map(|c| c.round() as usize);
            let is_open = open[k][i + volume.grid().size()[0] * j];
            assert!(
                is_open || !scan.free.contains(&k),
                "{}: surface inside, {voxel}",
                scan.name
            );
        }

        for &[k, j, expected] in scan.ends {
            let row = &slice(volume.grid(), &limb.mask, k)[j * volume.grid().size()[0]..];
            let row = &row[..volume.grid().size()[0]];
            let end = row.iter().rposition(|m| *m).expect("limb in that row");
            assert!(
                end.abs_diff(expected) <= 4,
                "{}: slice {k}, row {j} ends at {end}, by eye at {expected}",
                scan.name
            );
        }
    }
}

fn slice<'a, T>(grid: &Grid, values: &'a [T], k: usize) -> &'a [T] {
    let [nx, ny, _] = grid.size();
    &values[k * nx * ny..(k + 1) * nx * ny]
}

/// The piece of dense tissue of a slice that holds most of the limb.
fn dense_tissue(volume: &Volume, limb: &Limb, k: usize) -> Vec<bool> {
    let [nx, ny, _] = volume.grid().size();
    let inside = slice(volume.grid(), &limb.mask, k);
    let of_limb = |piece: &Vec<usize>| piece.iter().filter(|at| inside[**at]).count();
    let pieces = pieces(&is_dense(volume, k), [nx, ny]);
    let mut mask = vec![false; nx * ny];
    for at in pieces.into_iter().max_by_key(of_limb).unwrap_or_default() {
        mask[at] = true;
    }
    mask
}

/// Pixels of a slice that are not dense and are connected with the slice's border.
fn outside(volume: &Volume, k: usize) -> Vec<bool> {
    let [nx, ny, _] = volume.grid().size();
    let thin: Vec<bool> = is_dense(volume, k).iter().map(|dense| !dense).collect();
    let at_border = |at: &usize| {
        let (i, j) = (at % nx, at / nx);
        i == 0 || j == 0 || i + 1 == nx || j + 1 == ny
    };
    let mut mask = vec![false; nx * ny];
    for piece in pieces(&thin, [nx, ny]) {
        if piece.iter().any(at_border) {
            piece.into_iter().for_each(|at| mask[at] = true);
        }
    }
    mask
}

fn is_dense(volume: &Volume, k: usize) -> Vec<bool> {
    let [nx, ny, _] = volume.grid().size();
    let voxels = k * nx * ny..(k + 1) * nx * ny;
    voxels.map(|at| volume.values().at(at) >= SKIN_HU).collect()
}

/// Pieces of a mask of `size` voxels that are connected through sides.
fn pieces(mask: &[bool], [nx, ny]: [usize; 2]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; mask.len()];
    let mut found = Vec::new();
    for start in 0..mask.len() {
        if !mask[start] || seen[start] {
            continue;
        }
        seen[start] = true;
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            let at = piece[next];
            next += 1;
            let (i, j) = (at % nx, at / nx);
            let sides = [
                (i > 0).then(|| at - 1),
                (i + 1 < nx).then(|| at + 1),
                (j > 0).then(|| at - nx),
                (j + 1 < ny).then(|| at + nx),
            ];
            for side in sides.into_iter().flatten() {
                if mask[side] && !seen[side] {
                    seen[side] = true;
                    piece.push(side);
                }
            }
        }
        found.push(piece);
    }
    found
}

/// A slice's mask grown by `reach` voxels along its rows and columns.
fn widened(grid: &Grid, mask: &[bool], reach: usize) -> Vec<bool> {
    let [nx, ny, _] = grid.size();
    (0..nx * ny)
        .map(|at| {
            let (i, j) = (at % nx, at / nx);
            let rows = j.saturating_sub(reach)..=(j + reach).min(ny - 1);
            rows.into_iter().any(|y| {
                let columns = i.saturating_sub(reach)..=(i + reach).min(nx - 1);
                columns.into_iter().any(|x| mask[x + nx * y])
            })
        })
        .collect()
}
