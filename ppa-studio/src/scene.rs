//! Images of a pose, and the data shared between requests: room, cameras, beam and voxels.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use image::GrayImage;
use ppa_dataset::BodyShape;
use ppa_dataset::layout::LimbId;
use ppa_depth::DepthImage;
use ppa_generate::{
    ExposableLimb, Plan, SceneSetup, ShapeSettings, VisibleLimb, XraySettings, prepared_phantom,
};
use ppa_scene::Contact;
use ppa_xray::{PreparedPhantom, Radiograph};
use serde::Serialize;

use crate::commands::of_prediction;
use crate::desk::Shown;
use crate::error::StudioError;
use crate::false_colours::side_by_side;
use crate::network::{Network, NetworkAnswer};
use crate::newest::Ticket;
use crate::png::png;
use crate::what_if::WhatIf;

/// A room with its cameras and beam, and the plan that it was made from.
struct KeptSetup {
    plan: Plan,
    setup: Arc<SceneSetup>,
}

/// Voxels of a limb around the central beam, and the inputs that they were made from.
struct KeptPhantom {
    revision: u64,
    plan: Plan,
    phantom: Arc<PreparedPhantom<'static>>,
}

/// A limb in another body shape, and the inputs that it was made from.
struct KeptShape {
    revision: u64,
    shape: BodyShape,
    of: LimbId,
    settings: ShapeSettings,
    seed: u64,
    limb: Arc<VisibleLimb>,
}

/// Cache of scenes and voxels for the next request.
#[derive(Default)]
pub(crate) struct Scenes {
    shape: Mutex<Option<KeptShape>>,
    setup: Mutex<Option<KeptSetup>>,
    phantom: Mutex<Option<KeptPhantom>>,
}

/// Both depth images of a pose.
pub(crate) struct DepthPicture {
    /// PNG in false colour, left camera at the left.
    pub png: Vec<u8>,
    pub report: DepthReport,
}

/// Report on the depth images.
#[derive(Debug, Serialize)]
pub(crate) struct DepthReport {
    /// Number of pixels with a depth, left camera first.
    pub valid_pixels: Vec<usize>,
    /// First and last depth of the colours, mm.
    pub range_mm: [f64; 2],
    /// Answer of the networks, if any are open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<NetworkAnswer>,
    /// Command for the same prediction, if networks are open and both cameras see the joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network_command: Option<String>,
}

/// A radiograph for viewing.
pub(crate) struct RadiographPicture {
    pub png: Vec<u8>,
    pub report: RadiographReport,
}

/// Report on a radiograph.
#[derive(Debug, Serialize)]
pub(crate) struct RadiographReport {
    pub exposure_index: Option<f64>,
    pub mas: Option<f64>,
    /// Incident air kerma at the skin, µGy.
    pub entrance_air_kerma_ugy: Option<f64>,
    pub contact: Contact,
}

/// Preview or final image of an exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// Larger pixels and fewer histories, within a tenth of the time.
    First,
    /// All pixels.
    Final,
}

impl Scenes {
    /// Frees the data computed from the limb.
    pub fn forget_limb(&self) {
        *self.shape.lock().unwrap_or_else(PoisonError::into_inner) = None;
        *self.phantom.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns room, cameras and beam of a plan, from the cache if no input has changed.
    pub fn setup(&self, plan: &Plan) -> Result<Arc<SceneSetup>, StudioError> {
        let mut kept = self.setup.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = &*kept
            && kept.plan.depth == plan.depth
            && same_room_and_beam(&kept.plan, plan)
        {
            return Ok(kept.setup.clone());
        }
        let setup = Arc::new(match &*kept {
            // Only cameras have changed: room and beam are kept.
            Some(kept) if same_room_and_beam(&kept.plan, plan) => kept.setup.with_cameras(plan)?,
            _ => SceneSetup::of_plan(plan)?,
        });
        *kept = Some(KeptSetup {
            plan: plan.clone(),
            setup: setup.clone(),
        });
        Ok(setup)
    }

    /// Renders both depth images and asks the networks.
    pub fn depth(
        &self,
        shown: &Shown,
        plan: &Plan,
        what_if: &WhatIf,
        patient: u32,
        network: Option<&Network>,
    ) -> Result<DepthPicture, StudioError> {
        let plan = what_if.plan(plan)?;
        let setup = self.setup(&plan)?;
        let views =
            |limb: &VisibleLimb| limb.depth_views(&setup, &plan, what_if.angle_deg, plan.seed);
        let side = shown.case.side;
        let views = match what_if.shape {
            None | Some(BodyShape::Orig) => views(&shown.limb)?,
            Some(shape) => views(&*self.shaped(shown, shape, &plan, LimbId { patient, side })?)?,
        };
        let images: Vec<&DepthImage> = views.iter().map(|view| &view.image).collect();
        let (picture, range_mm) = side_by_side(&images);
        let answer = network.map(|network| network.answer(side, &views));
        let regions = match &*views {
            [left, right] => left.region.zip(right.region),
            _ => None,
        };
        let network_command = network
            .zip(regions)
            .map(|(network, (left, right))| of_prediction(&network.networks, side, [left, right]));
        Ok(DepthPicture {
            png: png(picture)?,
            report: DepthReport {
                valid_pixels: images.iter().map(|image| image.valid_pixels()).collect(),
                range_mm,
                network: answer,
                network_command,
            },
        })
    }

    /// Returns the limb in another body shape, from the cache if no input has changed.
    fn shaped(
        &self,
        shown: &Shown,
        shape: BodyShape,
        plan: &Plan,
        of: LimbId,
    ) -> Result<Arc<VisibleLimb>, StudioError> {
        let mut kept = self.shape.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = &*kept
            && (kept.revision, kept.shape, kept.of) == (shown.revision, shape, of)
            && (&kept.settings, kept.seed) == (&plan.shapes, plan.seed)
        {
            return Ok(kept.limb.clone());
        }
        let limb = Arc::new(shown.limb.with_shape(shape, plan, of)?);
        *kept = Some(KeptShape {
            revision: shown.revision,
            shape,
            of,
            settings: plan.shapes.clone(),
            seed: plan.seed,
            limb: limb.clone(),
        });
        Ok(limb)
    }

    /// Returns the limb with everything needed for an exposure.
    pub fn exposable(&self, shown: &Shown, plan: &Plan) -> Result<ExposableLimb, StudioError> {
        let setup = self.setup(plan)?;
        let phantom = self.phantom(shown, plan)?;
        let (table, spectrum) = (setup.table.clone(), setup.spectrum.clone());
        let prepared = shown.prepared().clone();
        Ok(ExposableLimb::with_phantom(
            prepared, phantom, plan, table, spectrum,
        ))
    }

    /// Computes the radiograph, until a later request replaces this one.
    pub fn radiograph(
        &self,
        shown: &Shown,
        plan: &Plan,
        what_if: &WhatIf,
        pass: Pass,
        ticket: &Ticket,
    ) -> Result<RadiographPicture, StudioError> {
        let plan = &what_if.plan(plan)?;
        let limb = self.exposable(shown, plan)?;
        let exposure = limb.pose(what_if.angle_deg.to_radians())?;
        let settings = exposure.fast_settings(plan.xray.engine.with_seed(plan.seed))?;
        let observe = |_share: f64| {
            if ticket.is_newest() {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        };
        let projection = &exposure.projection;
        let (phantom, spectrum) = (&limb.phantom, &limb.spectrum);
        let radiograph = match pass {
            Pass::First => phantom.preview(spectrum, projection, &settings, &observe),
            Pass::Final => phantom.fast_with_progress(spectrum, projection, &settings, &observe),
        };
        let radiograph = radiograph.map_err(|error| match error {
            ppa_xray::TransportError::Cancelled => StudioError::Superseded,
            error => error.into(),
        })?;
        let kerma = phantom.entrance_air_kerma_gy_per_history(spectrum, projection)?;
        let kerma_ugy = kerma.map(|gray| 1e6 * gray * radiograph.histories);
        Ok(RadiographPicture {
            png: radiograph_png(&radiograph, &plan.xray)?,
            report: RadiographReport {
                exposure_index: radiograph.exposure_index(&projection.receptor)?,
                mas: radiograph.mas().filter(|mas| mas.is_finite()),
                entrance_air_kerma_ugy: kerma_ugy.filter(|ugy| ugy.is_finite()),
                contact: exposure.placement.contact,
            },
        })
    }

    /// Returns the voxels around the central beam, from the cache if no input has changed.
    fn phantom(
        &self,
        shown: &Shown,
        plan: &Plan,
    ) -> Result<Arc<PreparedPhantom<'static>>, StudioError> {
        let mut kept = self.phantom.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = &*kept
            && kept.revision == shown.revision
            && kept.plan.same_voxels(plan)
        {
            return Ok(kept.phantom.clone());
        }
        // Freed first, so that only one phantom is in memory.
        *kept = None;
        let phantom = Arc::new(prepared_phantom(shown.prepared(), plan)?);
        *kept = Some(KeptPhantom {
            revision: shown.revision,
            plan: plan.clone(),
            phantom: phantom.clone(),
        });
        Ok(phantom)
    }
}

/// Whether [`SceneSetup::of_plan`] gives the same room and beam for both.
fn same_room_and_beam(a: &Plan, b: &Plan) -> bool {
    let beam = |plan: &Plan| (plan.xray.kvp, plan.xray.anode_angle_deg);
    a.seed == b.seed && a.room == b.room && beam(a) == beam(b) && a.xray.filters == b.xray.filters
}

fn radiograph_png(radiograph: &Radiograph, xray: &XraySettings) -> Result<Vec<u8>, StudioError> {
    let grey = radiograph.present(&xray.presentation)?;
    let bytes = grey.iter().map(|value| (value >> 8) as u8).collect();
    let (columns, rows) = (radiograph.columns() as u32, radiograph.rows() as u32);
    let picture = GrayImage::from_raw(columns, rows, bytes).expect("one value for each pixel");
    Ok(png(picture)?)
}
