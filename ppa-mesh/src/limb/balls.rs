//! Balls in a scan in which nothing counts as limb, for cutting parts off by hand.

use nalgebra::Point3;
use ppa_ct::{Grid, Values, Volume, VolumeError};

use super::lattice::Lattice;
use super::settings::Ball;
use super::{Hu, LimbError};

/// HU of removed voxels.
const AIR_HU: f32 = -1000.0;

/// HU between the iso value and soft tissue, over a voxel: the surface of a ball is as steep as that of skin.
const FLESH_HU: f64 = 550.0;

/// Checks that the balls have finite centres and positive, finite radii.
pub fn check(balls: &[Ball]) -> Result<(), LimbError> {
    for ball in balls {
        let centre = ball.centre_mm.into_iter().find(|x| !x.is_finite());
        let radius = Some(ball.radius_mm).filter(|r| !(*r > 0.0 && r.is_finite()));
        let refused = |name, value, expected| LimbError::Setting {
            name,
            value,
            expected,
        };
        if let Some(value) = centre {
            return Err(refused(
                "removed[].centre_mm",
                value,
                "three finite numbers",
            ));
        }
        if let Some(value) = radius {
            return Err(refused("removed[].radius_mm", value, "positive"));
        }
    }
    Ok(())
}

/// Returns the volume with air in the balls, and the removed volume above `iso`, mm³.
///
/// The values fall from flesh to air across a voxel, so that the new iso surface is that of the ball.
pub fn without(volume: &Volume, balls: &[Ball], iso: f64) -> Result<(Volume, f64), VolumeError> {
    let grid = volume.grid();
    match volume.values() {
        Values::I16(hu) => {
            let (hu, removed_mm3) = emptied(grid, hu.to_vec(), balls, iso, |hu| hu.round() as i16);
            Ok((Volume::from_i16(grid.clone(), hu)?, removed_mm3))
        }
        Values::F32(hu) => {
            let (hu, removed_mm3) = emptied(grid, hu.to_vec(), balls, iso, |hu| hu);
            Ok((Volume::new(grid.clone(), hu)?, removed_mm3))
        }
    }
}

fn emptied<T: Hu>(
    grid: &Grid,
    mut hu: Vec<T>,
    balls: &[Ball],
    iso: f64,
    kept_as: impl Fn(f32) -> T,
) -> (Vec<T>, f64) {
    let steepness = FLESH_HU / grid.spacing_mm().max();
    let mut voxels = 0_usize;
    for ball in balls {
        let centre = Point3::from(ball.centre_mm);
        let [low, high] = around(grid, &centre, ball.radius_mm + grid.spacing_mm().max());
        for k in low[2]..high[2] {
            for j in low[1]..high[1] {
                for i in low[0]..high[0] {
                    let voxel = [i, j, k];
                    let off = grid.centre(voxel.map(|v| v as f64)) - centre;
                    let outside_mm = off.norm() - ball.radius_mm;
                    if outside_mm >= grid.spacing_mm().max() {
                        continue;
                    }
                    let at = grid.index(voxel);
                    let before: f32 = hu[at].into();
                    let most = ((iso + steepness * outside_mm) as f32).max(AIR_HU);
                    voxels += usize::from(outside_mm < 0.0 && f64::from(before) >= iso);
                    if most < before {
                        hu[at] = kept_as(most);
                    }
                }
            }
        }
    }
    (hu, voxels as f64 * Lattice::of(grid).voxel_mm3)
}

/// Voxels, half-open, of a box that holds all within `reach_mm` of a point.
fn around(grid: &Grid, centre: &Point3<f64>, reach_mm: f64) -> [[usize; 3]; 2] {
    let voxel_from_ct = grid.voxel_from_ct();
    let middle = voxel_from_ct * centre;
    let linear = voxel_from_ct.matrix().fixed_view::<3, 3>(0, 0).into_owned();
    let ends = |axis: usize| {
        // Largest extent of a step of `reach_mm` along the axis.
        let reach = reach_mm * linear.row(axis).norm();
        let size = grid.size()[axis] as f64;
        let low = (middle[axis] - reach).ceil().clamp(0.0, size);
        let high = ((middle[axis] + reach).floor() + 1.0).clamp(low, size);
        [low as usize, high as usize]
    };
    let ends = [0, 1, 2].map(ends);
    [0, 1].map(|end| ends.map(|axis| axis[end]))
}
