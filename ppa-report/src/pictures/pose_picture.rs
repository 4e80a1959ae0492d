//! Picture for checking a limb on the table: the room with device and cameras, and the limb from three sides.

use image::RgbImage;
use nalgebra::{Point3, Vector3};
use ppa_dataset::findings::FindingCode;
use ppa_depth::RigError;
use ppa_generate::Plan;
use ppa_generate::PreparedLimb;
use ppa_generate::Table;
use ppa_mesh::{PointCloud, mean_spacing_mm};
use ppa_scene::Placement;

use super::canvas::{Canvas, Colour, Rect, mixed};
use super::case_picture::{limb_name, remarks};
use super::palette::{AXIS, BEAM, CAMERAS, CONTACT, CUT, DETECTOR, FAINT, INK, JOINT, SKIN, TABLE};
use super::panel;
use super::pose_scene::PoseScene;
use super::raster::Raster;
use super::sheet::{Frame, GAP, HEADER, PANELS_END, Swatch, WIDTH};
use super::view::View;

const OVERVIEW_WIDTH: u32 = 700;
const SIDE_WIDTH: u32 = 492;
const SIDE_HEIGHT: u32 = (PANELS_END - HEADER - 2 * GAP) / 3;

const ROOM_LAYER: u8 = 0;
const SKIN_LAYER: u8 = 1;
const CUT_LAYER: u8 = 2;

/// Height shown below the table top next to the limb, mm.
const BELOW_MM: f64 = 40.0;
/// Skin this close to the table counts as touching it, mm.
const TOUCHING_MM: f64 = 1.0;
/// Margin around limb, device and cameras in the overview, and around the limb in the other views, mm.
const AROUND_MM: [f64; 2] = [250.0, 60.0];
/// Lines this far behind a surface count as hidden, mm.
const BEHIND_MM: f64 = 4.0;
/// Opacity of lines hidden by a surface.
const HIDDEN: f64 = 0.3;
/// Side of the squares for points of a recorded room relative to their mean distance.
const SQUARE: f64 = 1.6;

/// A limb on the table of a plan.
#[derive(Clone, Copy)]
pub struct PosedLimb<'a> {
    /// The limb.
    pub limb: &'a PreparedLimb,
    /// Its placement on the table.
    pub placement: &'a Placement,
    /// Medial rotation, degrees.
    pub angle_deg: f64,
    /// The room with the table.
    pub table: &'a Table,
    /// Cameras and detector.
    pub plan: &'a Plan,
    /// Findings that its case acknowledges.
    pub acknowledged: &'a [FindingCode],
}

/// Draws a placed limb: the room with table, device, detector, beam and both cameras' fields of view, and the limb from its side,
/// from the source and from the feet with the points on which it rests.
///
/// `name` is the heading: a file's name without folders. At least 1600 x 1000 pixels; the same pose gives the same pixels.
///
/// # Errors
/// [`RigError`] for cameras that cannot be read or are invalid.
pub fn pose_picture(name: &str, posed: &PosedLimb) -> Result<RgbImage, RigError> {
    let rig = posed.plan.depth.cameras()?;
    let scene = PoseScene::new(
        posed.limb,
        posed.placement,
        posed.table,
        &rig,
        &posed.plan.xray.detector,
    )?;
    let middle = 2 * GAP + OVERVIEW_WIDTH;
    let right = middle + SIDE_WIDTH + GAP;
    let legend = Rect {
        x: right,
        y: HEADER,
        width: WIDTH - right - GAP,
        height: PANELS_END - HEADER,
    };
    let mut canvas = frame(name, posed).canvas(legend);
    let overview = Rect {
        x: GAP,
        y: HEADER,
        width: OVERVIEW_WIDTH,
        height: PANELS_END - HEADER,
    };
    draw_overview(&mut canvas, overview, &scene);
    let [across, head, up] = [0, 1, 2].map(|i| scene.axes.column(i).into_owned());
    let sides = [
        ("from the patient's left", head, up),
        ("from the x-ray source", across, head),
        ("from the feet", across, up),
    ];
    for (row, side) in (0..).zip(sides) {
        let rect = Rect {
            x: middle,
            y: HEADER + row * (SIDE_HEIGHT + GAP),
            width: SIDE_WIDTH,
            height: SIDE_HEIGHT,
        };
        draw_side(&mut canvas, rect, &scene, side);
    }
    Ok(canvas.into_image())
}

fn draw_overview(canvas: &mut Canvas, rect: Rect, scene: &PoseScene) {
    panel::ground(canvas, rect);
    let towards_viewer = scene.axes * Vector3::new(1.0, -0.9, 0.55).normalize();
    let up = scene.axes.column(2).into_owned();
    let up = (up - towards_viewer * towards_viewer.dot(&up)).normalize();
    let right = up.cross(&towards_viewer);
    let skin = scene.skin.vertices.iter().map(|p| p.cast::<f64>());
    let cones = scene.cones.iter().flat_map(|cone| {
        let ends = cone.corners.into_iter();
        ends.chain([cone.eye])
    });
    let around: Vec<_> = skin
        .chain(cones)
        .chain(scene.detector)
        .chain([scene.source])
        .collect();
    let view = View::fitting(rect, [right, up], around.iter().copied());
    let raster = rasterised(rect, view, scene, &around, AROUND_MM[0]);
    canvas.within(rect, |canvas| {
        paint(canvas, &raster, scene);
        let mut line =
            |from, to, width, colour| stroke(canvas, &raster, &view, [from, to], width, colour);
        for corner in scene.detector {
            line(scene.source, corner, 1.0, BEAM);
        }
        for (cone, colour) in scene.cones.iter().zip(CAMERAS) {
            for corner in cone.corners {
                line(cone.eye, corner, 1.5, colour);
            }
            for (from, to) in sides(&cone.corners) {
                line(from, to, 2.5, colour);
            }
        }
        draw_device(canvas, &raster, &view, scene);
        for (cone, colour) in scene.cones.iter().zip(CAMERAS) {
            let at = view.pixel(&cone.eye);
            canvas.ring(at, 0.0, 8.0, [0; 3]);
            canvas.ring(at, 0.0, 6.0, colour);
            let below = [at[0].max(0.0) as u32 + 12, at[1].max(0.0) as u32];
            canvas.text(cone.name, below, 2, colour);
        }
        draw_limb_marks(canvas, &view, scene);
    });
    panel::title(canvas, rect, "the room");
    panel::scale_bar(canvas, rect, &view);
}

fn draw_side(
    canvas: &mut Canvas,
    rect: Rect,
    scene: &PoseScene,
    (title, right, up): (&str, Vector3<f64>, Vector3<f64>),
) {
    panel::ground(canvas, rect);
    let skin: Vec<_> = scene
        .skin
        .vertices
        .iter()
        .map(|p| p.cast::<f64>())
        .collect();
    let table = &scene.table.plane.plane;
    let up_mm = scene.axes.column(2) * BELOW_MM;
    let below = skin.iter().map(|point| table.project(point) - up_mm);
    let view = View::fitting(rect, [right, up], skin.iter().copied().chain(below));
    let raster = rasterised(rect, view, scene, &skin, AROUND_MM[1]);
    canvas.within(rect, |canvas| {
        paint(canvas, &raster, scene);
        draw_device(canvas, &raster, &view, scene);
        draw_limb_marks(canvas, &view, scene);
    });
    panel::title(canvas, rect, title);
    panel::scale_bar(canvas, rect, &view);
}

/// Rasterises the limb and the part of the room near some points.
fn rasterised(
    rect: Rect,
    view: View,
    scene: &PoseScene,
    around: &[Point3<f64>],
    more_mm: f64,
) -> Raster {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = -low;
    for point in around {
        (low, high) = (low.inf(&point.coords), high.sup(&point.coords));
    }
    let more = Vector3::repeat(more_mm);
    let mut raster =
        Raster::new(rect, view).within(Point3::from(low - more), Point3::from(high + more));
    let room = &scene.table.room;
    match &room.mesh {
        Some(mesh) => raster.mesh(mesh, ROOM_LAYER),
        None => draw_cloud(&mut raster, &room.cloud),
    }
    raster.mesh(&scene.skin, SKIN_LAYER);
    raster.mesh(&scene.cuts, CUT_LAYER);
    raster
}

fn draw_cloud(raster: &mut Raster, cloud: &PointCloud) {
    // A single point has no distance to others; any square shows it.
    let spacing_mm = mean_spacing_mm(&cloud.points).unwrap_or(1.0);
    raster.cloud(cloud, SQUARE * spacing_mm, ROOM_LAYER);
}

fn paint(canvas: &mut Canvas, raster: &Raster, scene: &PoseScene) {
    let table = &scene.table.plane.plane;
    raster.paint(canvas, |seen| {
        let touches = table.signed_distance(&seen.point) < TOUCHING_MM;
        let colour = match seen.layer {
            ROOM_LAYER => TABLE,
            CUT_LAYER => CUT,
            _ if seen.from_behind => mixed(CUT, [0; 3], 0.4),
            _ if touches => CONTACT,
            _ => SKIN,
        };
        raster.lit(colour, &seen.normal)
    });
}

/// Source, central beam and detector.
fn draw_device(canvas: &mut Canvas, raster: &Raster, view: &View, scene: &PoseScene) {
    for (from, to) in sides(&scene.detector) {
        stroke(canvas, raster, view, [from, to], 2.5, DETECTOR);
    }
    let beam = [scene.source, scene.beam_end];
    stroke(canvas, raster, view, beam, 2.0, BEAM);
    let source = view.pixel(&scene.source);
    canvas.ring(source, 0.0, 8.0, [0; 3]);
    canvas.ring(source, 0.0, 6.0, BEAM);
}

/// Axis, joint and contacts.
fn draw_limb_marks(canvas: &mut Canvas, view: &View, scene: &PoseScene) {
    let [from, to] = scene.axis.map(|end| view.pixel(&end));
    canvas.line(from, to, 1.5, AXIS);
    for contact in &scene.contacts {
        let at = view.pixel(contact);
        canvas.ring(at, 5.0, 9.0, [0; 3]);
        canvas.ring(at, 6.0, 8.0, INK);
        canvas.ring(at, 0.0, 4.0, CONTACT);
    }
    let at = view.pixel(&scene.joint);
    canvas.ring(at, 0.0, 6.0, [0; 3]);
    canvas.ring(at, 0.0, 4.5, JOINT);
}

/// Draws a line in space, fainter where a surface hides it.
fn stroke(
    canvas: &mut Canvas,
    raster: &Raster,
    view: &View,
    [from, to]: [Point3<f64>; 2],
    width: f64,
    colour: Colour,
) {
    canvas.stroke(view.pixel(&from), view.pixel(&to), width, |t| {
        let point = from + (to - from) * t;
        let hidden = raster
            .nearness(view.pixel(&point))
            .is_some_and(|near| near > view.nearness(&point) + BEHIND_MM);
        Some((colour, if hidden { HIDDEN } else { 1.0 }))
    });
}

/// Height of a part of the limb above the table, in hundredths of a millimetre.
fn above(part: &str, height_mm: f64) -> String {
    let hundredths = (100.0 * height_mm).round();
    let place = if hundredths < 0.0 { "inside" } else { "above" };
    format!(
        "{part} part {:.2} mm {place} the table",
        0.01 * hundredths.abs()
    )
}

/// The sides of a quadrilateral.
fn sides(corners: &[Point3<f64>; 4]) -> impl Iterator<Item = (Point3<f64>, Point3<f64>)> {
    let corners = *corners;
    (0..4).map(move |i| (corners[i], corners[(i + 1) % 4]))
}

fn frame(name: &str, posed: &PosedLimb) -> Frame {
    let contact = &posed.placement.contact;
    let legend = [
        (Swatch::Area(SKIN), "limb"),
        (Swatch::Area(TABLE), "table and room"),
        (Swatch::Dot(BEAM), "x-ray source, beam"),
        (Swatch::Line(DETECTOR), "detector"),
        (Swatch::Line(CAMERAS[0]), "left camera's view"),
        (Swatch::Line(CAMERAS[1]), "right camera's view"),
        (Swatch::Line(AXIS), "limb's axis"),
        (Swatch::Dot(JOINT), "joint"),
        (Swatch::Area(CONTACT), "touches the table"),
        (Swatch::Dot(CONTACT), "lowest points"),
        (Swatch::Area(CUT), "cut by the field of view"),
        (Swatch::Line(FAINT), "fainter: hidden"),
    ];
    let mut facts = vec![
        format!("rotation {:.1} deg", posed.angle_deg),
        format!("tilt {:.1} deg", contact.tilt_rad.to_degrees()),
    ];
    let positioning = &posed.plan.positioning;
    if positioning.tilt_deg == 0.0 {
        facts.push(format!("contacts {:.0} mm apart", contact.apart_mm));
    } else {
        facts.push(format!("of it {:.1} deg by the plan", positioning.tilt_deg));
    }
    let [across_mm, along_mm] = positioning.beam_shift_mm;
    if [across_mm, along_mm] != [0.0; 2] {
        facts.push(format!("beam {across_mm:.0}, {along_mm:.0} mm off"));
    }
    facts.extend([
        above("distal", contact.distal_mm),
        above("proximal", contact.proximal_mm),
    ]);
    Frame {
        title: format!(
            "{name}   {}   {:.1} degrees medial",
            limb_name(&posed.limb.landmarks),
            posed.angle_deg
        ),
        legend: legend
            .map(|(swatch, text)| (swatch, text.to_owned()))
            .to_vec(),
        facts,
        remarks: remarks(posed.limb, posed.acknowledged),
    }
}
