//! Overview picture of a dataset: depth images in false colour and radiographs, one column per pose.

use std::path::{Path, PathBuf};

use image::imageops::{FilterType, resize};
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use ppa_dataset::BodyShape;
use ppa_dataset::files::FileError;
use ppa_dataset::layout::{LimbId, View, angle_text};
use ppa_dataset::manifest::{FileKind, FileRow, Manifest, RoiFile, RoiRow};
use ppa_dataset::published::{GrayImage16, ImageFileError};
use ppa_depth::false_colour;
use ppa_generate::{FolderError, made_images};

use crate::drawing::write_text;

const TILE: u32 = 208;
const GAP: u32 = 6;
const CAPTION: u32 = 22;
/// Width to the left of the rows: ten letters of 16 pixels, with a gap on both sides.
const MARGIN: u32 = 172;
/// Height of the colour scale below the rows, and length of its bar.
const SCALE: [u32; 2] = [28, 420];
/// Size of text: pixels per dot of the 8 x 8 font.
const TEXT: u32 = 2;

/// Why a contact sheet could not be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContactSheetError {
    /// A file of the dataset cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder of an unfinished dataset.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The dataset has no poses of this limb.
    #[error("{} contains no depth images of {limb}", root.display())]
    Empty {
        /// The dataset.
        root: PathBuf,
        /// The limb.
        limb: LimbId,
    },
}

/// Draws up to `columns` evenly spaced poses of one limb: one row for each camera with the original shape and one for each further
/// shape, with the radiographs below.
///
/// Depth images are cropped to their region of interest and share one colour scale: the 1st to the 99th percentile of all depths
/// shown, near red, far blue, invalid black; the scale is drawn below in mm. A cross marks an image that cannot be read or has no
/// region of interest.
///
/// # Errors
/// [`ContactSheetError`] when a list is missing or unreadable, or contains nothing of the limb.
pub fn contact_sheet(
    root: &Path,
    limb: LimbId,
    columns: usize,
) -> Result<RgbImage, ContactSheetError> {
    Ok(draw(&tiles(root, limb, columns)?))
}

/// Draws the contact sheet of the finished poses while `generate` makes the others.
///
/// # Errors
/// [`ContactSheetError`] when `root` contains no dataset, or no pose of the limb is finished.
pub fn growing_contact_sheet(
    root: &Path,
    limb: LimbId,
    columns: usize,
) -> Result<RgbImage, ContactSheetError> {
    let made = made_images(root, limb)?;
    let tiles = tiles_of(root, limb, columns, &made.files, &made.rois)?;
    Ok(draw(&tiles))
}

/// Evenly spaced poses of one limb as rows of small pictures.
pub(crate) struct Tiles {
    /// Half degrees of rotation, one per column.
    pub steps: Vec<u32>,
    /// Depths of the ends of the colour scale, mm.
    pub range_mm: [f64; 2],
    /// Name of each row and its pictures, one per column.
    pub rows: Vec<(String, Vec<RgbImage>)>,
}

/// The content of [`contact_sheet`].
pub(crate) fn tiles(root: &Path, limb: LimbId, columns: usize) -> Result<Tiles, ContactSheetError> {
    let manifest = Manifest::read(root)?;
    let rois = manifest.rois(limb)?;
    tiles_of(root, limb, columns, &manifest.files, &rois)
}

fn tiles_of(
    root: &Path,
    limb: LimbId,
    columns: usize,
    files: &[FileRow],
    rois: &RoiFile,
) -> Result<Tiles, ContactSheetError> {
    let of_limb = |kind| {
        let rows = files.iter();
        rows.filter(move |row| row.kind == kind && row.limb == limb)
    };
    let mut steps: Vec<u32> = of_limb(FileKind::Depth).map(|row| row.step).collect();
    steps.sort_unstable();
    steps.dedup();
    if steps.is_empty() {
        return Err(ContactSheetError::Empty {
            root: root.to_owned(),
            limb,
        });
    }
    let steps = evenly_chosen(&steps, columns);

    let mut rows: Vec<(String, Vec<Tile>)> = Vec::new();
    for (shape, view) in depth_rows(of_limb(FileKind::Depth)) {
        let tiles = steps.iter().map(|&step| {
            let depth = read_gray16(&root.join(limb.depth(shape, view, step)));
            let roi = rois.get(&LimbId::depth_name(view, step));
            let cropped = depth.ok().zip(roi).map(|(depth, roi)| crop(&depth, roi));
            cropped.map_or(Tile::Unreadable, Tile::Depth)
        });
        let caption = format!(
            "{} {}",
            shape.name(),
            view.name().trim_start_matches("cam_")
        );
        rows.push((caption, tiles.collect()));
    }
    if of_limb(FileKind::Radiograph).next().is_some() {
        let tiles = steps.iter().map(|&step| {
            let image = read_gray16(&root.join(limb.radiograph_png(step)));
            image.map_or(Tile::Unreadable, Tile::Radiograph)
        });
        rows.push(("radiograph".to_owned(), tiles.collect()));
    }
    let range_mm = depth_range(&rows);
    let picture = |tile: &Tile| match tile {
        Tile::Depth(depth) => coloured(depth, range_mm),
        Tile::Radiograph(image) => fit(image),
        Tile::Unreadable => cross(),
    };
    let rows = rows.iter();
    let rows = rows.map(|(caption, tiles)| (caption.clone(), tiles.iter().map(picture).collect()));
    Ok(Tiles {
        steps,
        range_mm,
        rows: rows.collect(),
    })
}

type Gray16 = ImageBuffer<Luma<u16>, Vec<u16>>;

enum Tile {
    Depth(Gray16),
    Radiograph(Gray16),
    Unreadable,
}

/// The original in both views, then each further shape in the left view.
fn depth_rows<'a>(files: impl Iterator<Item = &'a FileRow>) -> Vec<(BodyShape, View)> {
    let mut rows: Vec<_> = files
        .filter_map(|row| Some((row.shape, row.camera?)))
        .filter(|(shape, view)| *shape == BodyShape::Orig || *view == View::Left)
        .collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

pub(crate) fn evenly_chosen(steps: &[u32], columns: usize) -> Vec<u32> {
    let count = columns.clamp(1, steps.len());
    let last = (steps.len() - 1) as f64;
    let at = |i: usize| (i as f64 * last / (count.max(2) - 1) as f64).round() as usize;
    (0..count).map(|i| steps[at(i)]).collect()
}

fn read_gray16(path: &Path) -> Result<Gray16, ImageFileError> {
    let image = GrayImage16::read(path)?;
    let buffer = ImageBuffer::from_raw(image.width, image.height, image.pixels);
    Ok(buffer.expect("a decoded image holds all its pixels"))
}

fn crop(depth: &Gray16, roi: &RoiRow) -> Gray16 {
    image::imageops::crop_imm(depth, roi.x_start, roi.y_start, roi.size, roi.size).to_image()
}

/// Nearest and farthest depth of the colour scale, mm.
fn depth_range(rows: &[(String, Vec<Tile>)]) -> [f64; 2] {
    let mut depths: Vec<u16> = rows
        .iter()
        .flat_map(|(_, tiles)| tiles)
        .filter_map(|tile| match tile {
            Tile::Depth(depth) => Some(depth),
            Tile::Radiograph(_) | Tile::Unreadable => None,
        })
        .flat_map(|depth| depth.pixels().map(|p| p.0[0]).filter(|&z| z > 0))
        .collect();
    if depths.is_empty() {
        return [0.0, 1.0];
    }
    depths.sort_unstable();
    let at = |fraction: f64| f64::from(depths[((depths.len() - 1) as f64 * fraction) as usize]);
    [at(0.01), at(0.99)]
}

fn draw(tiles: &Tiles) -> RgbImage {
    let (columns, rows) = (tiles.steps.len() as u32, tiles.rows.len() as u32);
    let width = MARGIN + columns.max(4) * (TILE + GAP) + GAP;
    let below = GAP + rows * (TILE + CAPTION + GAP);
    let mut sheet = RgbImage::from_pixel(width, below + SCALE[0], Rgb([24; 3]));
    for (r, (caption, pictures)) in (0..).zip(&tiles.rows) {
        let y = GAP + r * (TILE + CAPTION + GAP);
        for (line, word) in (0..).zip(caption.split(' ')) {
            write_text(&mut sheet, word, GAP, y + 20 * line, TEXT);
        }
        for (c, (picture, &step)) in (0..).zip(pictures.iter().zip(&tiles.steps)) {
            let x = MARGIN + c * (TILE + GAP);
            image::imageops::replace(&mut sheet, picture, i64::from(x), i64::from(y));
            let angle = format!("{} deg", angle_text(step));
            write_text(&mut sheet, &angle, x + 4, y + TILE + 4, TEXT);
        }
    }
    draw_scale(&mut sheet, tiles.range_mm, below);
    sheet
}

/// Draws the colours of depths from near to far, with both ends in mm.
fn draw_scale(sheet: &mut RgbImage, range_mm: [f64; 2], y: u32) {
    let [near, far] = range_mm.map(|mm| format!("{mm:.0} mm"));
    let letters = |text: &str| 8 * TEXT * text.len() as u32;
    write_text(sheet, "depth", GAP, y, TEXT);
    write_text(sheet, &near, MARGIN, y, TEXT);
    let start = MARGIN + letters(&near) + 2 * GAP;
    for x in 0..SCALE[1] {
        let share = f64::from(x) / f64::from(SCALE[1] - 1);
        let depth = range_mm[0] + share * (range_mm[1] - range_mm[0]);
        for dy in 0..8 * TEXT {
            if let Some(pixel) = sheet.get_pixel_mut_checked(start + x, y + dy) {
                *pixel = Rgb(false_colour(depth, range_mm));
            }
        }
    }
    write_text(sheet, &far, start + SCALE[1] + 2 * GAP, y, TEXT);
}

/// A region of a depth image as a tile in false colour.
fn coloured(depth: &Gray16, range_mm: [f64; 2]) -> RgbImage {
    let small = resize(depth, TILE, TILE, FilterType::Nearest);
    RgbImage::from_fn(TILE, TILE, |x, y| {
        Rgb(false_colour(small.get_pixel(x, y).0[0].into(), range_mm))
    })
}

/// Replaces an image that cannot be read.
fn cross() -> RgbImage {
    let on_diagonal = |x: u32, y: u32| x.abs_diff(y) < 2 || (x + y).abs_diff(TILE - 1) < 2;
    RgbImage::from_fn(TILE, TILE, |x, y| {
        Rgb(if on_diagonal(x, y) {
            [200, 60, 60]
        } else {
            [40; 3]
        })
    })
}

/// A grey image scaled to fit a tile, with its aspect ratio kept.
fn fit(image: &Gray16) -> RgbImage {
    let scale = f64::from(TILE) / f64::from(image.width().max(image.height()));
    let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).clamp(1, TILE);
    let gray: GrayImage = image::DynamicImage::ImageLuma16(image.clone()).into_luma8();
    let small = resize(
        &gray,
        side(image.width()),
        side(image.height()),
        FilterType::Triangle,
    );
    let mut tile = RgbImage::new(TILE, TILE);
    let (x, y) = ((TILE - small.width()) / 2, (TILE - small.height()) / 2);
    let colour = image::DynamicImage::ImageLuma8(small).into_rgb8();
    image::imageops::replace(&mut tile, &colour, i64::from(x), i64::from(y));
    tile
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_chosen_from_end_to_end() {
        assert_eq!(evenly_chosen(&[0, 36, 90, 180], 9), [0, 36, 90, 180]);
        assert_eq!(
            evenly_chosen(&(0..=180).collect::<Vec<_>>(), 3),
            [0, 90, 180]
        );
        assert_eq!(evenly_chosen(&[4, 5], 1), [4]);
    }
}
