//! Scene common to all limbs of a plan: room, table, x-ray device, cameras, beam.

use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Isometry3;
use ppa_dataset::layout::View;
use ppa_depth::{
    Backdrop, Body, Camera, DepthImage, MeshBody, MountedCamera, PlacedBody, RigError, Sensor,
    SensorError, SurfelBody,
};
use ppa_mesh::{CloudError, Mesh, MeshContents, PointCloud, estimate_normals, mean_spacing_mm};
use ppa_scene::{
    Landmarks, PlaceError, PlaceSettings, Placement, PlaneSettings, Rigid, RoomError, TablePlane,
    XrayDevice, XrayRoom, place_with, table_plane,
};
use ppa_xray::{Spectrum, TubeSpec};

use crate::plan::{Plan, PlanRoom, XraySettings};
use crate::seed::{Purpose, plan_seed};

/// Why a plan's room, cameras or beam cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneSetupError {
    /// The room cannot be used.
    #[error(transparent)]
    Room(#[from] RoomError),
    /// The pose of the device in a recorded room is invalid.
    #[error("room.room_from_device of the plan")]
    DevicePose(#[from] ppa_depth::RigidError),
    /// The points of a recorded room cannot be used.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// The table of the room was not found.
    #[error(transparent)]
    Table(#[from] ppa_scene::PlaneError),
    /// The camera rig cannot be used.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The errors of the cameras' sensors are invalid.
    #[error("depth.sensor of the plan")]
    Sensor(#[from] SensorError),
    /// Points or triangles of a recorded room cannot be rendered.
    #[error("{}", path.display())]
    RoomFile {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<SceneSetupError>,
    },
    /// The furniture cannot be rendered.
    #[error(transparent)]
    Body(#[from] ppa_depth::BodyError),
    /// The x-ray beam cannot be computed.
    #[error(transparent)]
    Spectrum(#[from] ppa_xray::SpectrumError),
}

/// A placed camera with its view of the empty room.
pub struct PlacedCamera {
    /// Left or right.
    pub view: View,
    /// Lens and sensor.
    pub camera: Camera,
    /// Its pose.
    pub camera_from_room: Isometry3<f64>,
    /// Depth image of the room without the limb; rendered once, since nothing in it moves.
    pub background: DepthImage,
    /// The sensor, if it is not ideal, and its view of the empty room.
    pub sensor: Option<(Sensor, Backdrop)>,
}

impl PlacedCamera {
    /// Creates a camera with its view of the furniture of a room.
    pub fn new(
        view: View,
        camera: Camera,
        camera_from_room: Isometry3<f64>,
        furniture: &Body,
        sensor: Option<Sensor>,
    ) -> Self {
        let empty_room = PlacedBody {
            body: furniture,
            camera_from_body: camera_from_room,
        };
        let sensor = sensor.map(|sensor| (sensor, Backdrop::new(&camera, &[empty_room])));
        let background = match &sensor {
            Some((_, backdrop)) => backdrop.image.clone(),
            None => ppa_depth::render(&camera, &[empty_room]),
        };
        Self {
            view,
            camera,
            camera_from_room,
            background,
            sensor,
        }
    }
}

/// Room, table and x-ray device: everything needed to place a limb.
pub struct Table {
    /// The room with its furniture and device.
    pub room: XrayRoom,
    /// Π_T.
    pub plane: TablePlane,
}

impl Table {
    /// Loads or builds the room of a plan and finds its table.
    ///
    /// # Errors
    /// [`SceneSetupError`] naming the room or table at fault.
    pub fn of_plan(plan: &Plan) -> Result<Self, SceneSetupError> {
        let room = load_room(&plan.room)?;
        let seed = plan_seed(plan.seed, Purpose::TablePlane);
        let by_device = PlaneSettings::for_device(&room.device);
        let settings = plan.room.table.as_ref().unwrap_or(&by_device);
        let plane = table_plane(&room.cloud, settings, seed)?;
        Ok(Self { room, plane })
    }

    /// Lays a skin (`ct` frame) on the table, rotated medially by an angle in radians.
    ///
    /// # Errors
    /// [`PlaceError`] when the limb does not rest there.
    pub fn place(
        &self,
        skin: &Mesh,
        landmarks: &Landmarks,
        angle_rad: f64,
        settings: &PlaceSettings,
    ) -> Result<Placement, PlaceError> {
        let (plane, device) = (&self.plane.plane, &self.room.device);
        place_with(
            &skin.vertices,
            landmarks,
            angle_rad,
            plane,
            device,
            settings,
        )
    }

    /// Distance from the source to the table top along the central beam, mm.
    pub fn source_table_mm(&self) -> f64 {
        let (device, plane) = (&self.room.device, &self.plane.plane);
        let above_mm = plane.normal.dot(&device.source().coords) - plane.offset_mm;
        -above_mm / plane.normal.dot(&device.beam_direction())
    }

    /// The furniture of the room for the cameras: its triangles, or discs at its points.
    ///
    /// # Errors
    /// [`SceneSetupError`] for points whose normals cannot be found or that cannot be rendered.
    pub fn furniture(&self) -> Result<Body, SceneSetupError> {
        if let Some(mesh) = &self.room.mesh {
            return Ok(Body::Mesh(MeshBody::new(&mesh.vertices, &mesh.triangles)?));
        }
        body_of_cloud(&self.room.cloud)
    }
}

/// The contents of a mesh file for the cameras: its triangles, or discs at the points of a cloud.
///
/// # Errors
/// [`SceneSetupError`] for points or triangles that cannot be rendered.
pub fn body_of_contents(contents: &MeshContents) -> Result<Body, SceneSetupError> {
    if contents.triangles.is_empty() {
        return body_of_cloud(&contents.cloud);
    }
    let mesh = MeshBody::new(&contents.cloud.points, &contents.triangles)?;
    Ok(Body::Mesh(mesh))
}

/// Discs at the points of a recorded room, for the cameras.
///
/// # Errors
/// [`SceneSetupError`] for points whose normals cannot be found or that cannot be rendered.
pub fn body_of_cloud(cloud: &PointCloud) -> Result<Body, SceneSetupError> {
    let points = &cloud.points;
    let estimated;
    let normals = if cloud.normals.len() == points.len() {
        &cloud.normals
    } else {
        estimated = estimate_normals(points, NORMAL_NEIGHBOURS)?;
        &estimated
    };
    let radius_mm = DISC_RADIUS * mean_spacing_mm(points)?;
    Ok(Body::Surfels(SurfelBody::new(points, normals, radius_mm)?))
}

/// Everything that is fixed while the limb rotates.
pub struct SceneSetup {
    /// Room, table and device.
    pub table: Arc<Table>,
    /// Both cameras, left first.
    pub cameras: Vec<PlacedCamera>,
    /// The beam.
    pub spectrum: Arc<Spectrum>,
}

impl SceneSetup {
    /// The scene setup of a plan.
    ///
    /// # Errors
    /// [`SceneSetupError`] naming the room, table, camera or beam at fault.
    pub fn of_plan(plan: &Plan) -> Result<Self, SceneSetupError> {
        let table = Table::of_plan(plan)?;
        Ok(Self {
            cameras: place_cameras(&table, plan)?,
            table: Arc::new(table),
            spectrum: Arc::new(spectrum(&plan.xray)?),
        })
    }

    /// The same room and beam with the cameras of a plan.
    ///
    /// # Errors
    /// [`SceneSetupError`] naming the camera at fault.
    pub fn with_cameras(&self, plan: &Plan) -> Result<Self, SceneSetupError> {
        Ok(Self {
            cameras: place_cameras(&self.table, plan)?,
            table: self.table.clone(),
            spectrum: self.spectrum.clone(),
        })
    }
}

/// The cameras of a plan with their views of the furniture, left first.
fn place_cameras(table: &Table, plan: &Plan) -> Result<Vec<PlacedCamera>, SceneSetupError> {
    let rig = plan.depth.cameras()?;
    let furniture = match (table.furniture(), &plan.room.ply) {
        (Err(source), Some(path)) => {
            return Err(SceneSetupError::RoomFile {
                path: path.clone(),
                source: source.into(),
            });
        }
        (furniture, _) => furniture?,
    };
    let device = &table.room.device;
    let place = |view, side, mounted: &MountedCamera| {
        let camera = Camera::try_from(mounted.camera.clone())
            .map_err(|source| RigError::Camera { side, source })?;
        let device_from_camera = mounted
            .pose()
            .map_err(|source| RigError::Pose { side, source })?;
        let room_from_camera = device.room_from_device.isometry() * device_from_camera;
        let sensor = plan.depth.sensor.clone().map(|spec| {
            // Each camera has its own errors.
            let seed = plan_seed(plan.seed, Purpose::DepthSensor).wrapping_add(view as u64);
            Sensor::new(spec, seed)
        });
        let camera_from_room = room_from_camera.inverse();
        Ok::<_, SceneSetupError>(PlacedCamera::new(
            view,
            camera,
            camera_from_room,
            &furniture,
            sensor.transpose()?,
        ))
    };
    Ok(vec![
        place(View::Left, "left", &rig.left)?,
        place(View::Right, "right", &rig.right)?,
    ])
}

/// The tube of a plan and its filters.
///
/// # Errors
/// [`SceneSetupError::Spectrum`] for a filter that cannot be read.
pub fn tube(settings: &XraySettings) -> Result<TubeSpec, SceneSetupError> {
    Ok(settings.tube()?)
}

/// The beam of a plan.
///
/// # Errors
/// [`SceneSetupError::Spectrum`] for a voltage, anode or filter out of range.
pub fn spectrum(settings: &XraySettings) -> Result<Spectrum, SceneSetupError> {
    Ok(Spectrum::tungsten(&tube(settings)?)?)
}

fn load_room(plan: &PlanRoom) -> Result<XrayRoom, SceneSetupError> {
    let built_in = XrayRoom::parametric(&plan.parametric)?;
    let Some(path) = &plan.ply else {
        return Ok(built_in);
    };
    let device = match &plan.room_from_device {
        Some(rows) => XrayDevice {
            room_from_device: Rigid::new(ppa_depth::isometry_from_rows(rows)?),
            ..built_in.device
        },
        None => built_in.device,
    };
    Ok(XrayRoom::from_ply(path, device)?)
}

/// Neighbours from which the normal of a recorded point is estimated.
const NORMAL_NEIGHBOURS: usize = 16;

/// Radius of the discs of a recorded room over the mean distance of its points; leaves no holes
/// in scattered points (see [`SurfelBody`]).
const DISC_RADIUS: f64 = 1.5;
