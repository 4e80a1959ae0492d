//! Images of a pose, and what they share between requests: room, cameras, beam and voxels.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use image::{DynamicImage, GrayImage, ImageFormat};
use ppa_depth::DepthImage;
use ppa_generate::{ExposableLimb, Plan, SceneSetup, XraySettings, prepared_phantom};
use ppa_scene::Contact;
use ppa_xray::{PreparedPhantom, Radiograph};
use serde::Serialize;

use crate::desk::Shown;
use crate::error::StudioError;
use crate::false_colours::side_by_side;
use crate::network::{Network, NetworkAnswer};
use crate::newest::Ticket;
use crate::what_if::WhatIf;

/// A room with its cameras and beam, and the plan it was made from.
struct KeptSetup {
    plan: Plan,
    setup: Arc<SceneSetup>,
}

/// Voxels of a limb around its joint, and what they were made from.
struct KeptPhantom {
    revision: u64,
    xray: XraySettings,
    phantom: Arc<PreparedPhantom<'static>>,
}

/// Scenes and voxels kept for the next request.
#[derive(Default)]
pub(crate) struct Scenes {
    setup: Mutex<Option<KeptSetup>>,
    phantom: Mutex<Option<KeptPhantom>>,
}

/// Both depth images of a pose.
pub(crate) struct DepthPicture {
    /// In false colour, left camera at the left, PNG.
    pub png: Vec<u8>,
    pub report: DepthReport,
}

/// What is known of depth images.
#[derive(Debug, Serialize)]
pub(crate) struct DepthReport {
    /// Pixels with a depth, left camera first.
    pub valid_pixels: Vec<usize>,
    /// First and last depth of the colours, mm.
    pub range_mm: [f64; 2],
    /// What networks say of them, if any are open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<NetworkAnswer>,
}

/// A radiograph for viewing.
pub(crate) struct RadiographPicture {
    pub png: Vec<u8>,
    pub report: RadiographReport,
}

/// What is known of a radiograph.
#[derive(Debug, Serialize)]
pub(crate) struct RadiographReport {
    pub exposure_index: Option<f64>,
    pub mas: Option<f64>,
    /// Incident air kerma at the skin, µGy.
    pub entrance_air_kerma_ugy: Option<f64>,
    pub contact: Contact,
}

/// Which image of an exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// Larger pixels and fewer histories, within a tenth of the time.
    First,
    /// All pixels.
    Final,
}

impl Scenes {
    /// Room, cameras and beam of a plan: those of the request before, if nothing they depend on has changed.
    pub fn setup(&self, plan: &Plan) -> Result<Arc<SceneSetup>, StudioError> {
        let mut kept = self.setup.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = &*kept
            && same_setup(&kept.plan, plan)
        {
            return Ok(kept.setup.clone());
        }
        let setup = Arc::new(SceneSetup::of_plan(plan)?);
        *kept = Some(KeptSetup {
            plan: plan.clone(),
            setup: setup.clone(),
        });
        Ok(setup)
    }

    /// What both cameras see, and what networks say of it.
    pub fn depth(
        &self,
        shown: &Shown,
        plan: &Plan,
        what_if: &WhatIf,
        network: Option<&Network>,
    ) -> Result<DepthPicture, StudioError> {
        let plan = what_if.plan(plan)?;
        let setup = self.setup(&plan)?;
        let views = (shown.limb).depth_views(&setup, &plan, what_if.angle_deg, plan.seed)?;
        let images: Vec<&DepthImage> = views.iter().map(|view| &view.image).collect();
        let (picture, range_mm) = side_by_side(&images);
        let answer = network.map(|network| network.answer(shown.case.side, &views));
        Ok(DepthPicture {
            png: png(DynamicImage::ImageRgb8(picture))?,
            report: DepthReport {
                valid_pixels: images.iter().map(|image| image.valid_pixels()).collect(),
                range_mm,
                network: answer,
            },
        })
    }

    /// The radiograph, until a later request replaces this one.
    pub fn radiograph(
        &self,
        shown: &Shown,
        plan: &Plan,
        what_if: &WhatIf,
        pass: Pass,
        ticket: &Ticket,
    ) -> Result<RadiographPicture, StudioError> {
        let plan = &what_if.plan(plan)?;
        let setup = self.setup(plan)?;
        let phantom = self.phantom(shown, &plan.xray)?;
        let (table, spectrum) = (setup.table.clone(), setup.spectrum.clone());
        let prepared = shown.prepared().clone();
        let limb = ExposableLimb::with_phantom(prepared, phantom, plan, table, spectrum);
        let spectrum = &setup.spectrum;
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
        let phantom = &limb.phantom;
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

    /// Voxels around the joint: those of the request before, if nothing they depend on has changed.
    fn phantom(
        &self,
        shown: &Shown,
        xray: &XraySettings,
    ) -> Result<Arc<PreparedPhantom<'static>>, StudioError> {
        let mut kept = self.phantom.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = &*kept
            && kept.revision == shown.revision
            && kept.xray.same_voxels(xray)
        {
            return Ok(kept.phantom.clone());
        }
        // Freed first: both would need the memory of two.
        *kept = None;
        let phantom = Arc::new(prepared_phantom(shown.prepared(), xray)?);
        *kept = Some(KeptPhantom {
            revision: shown.revision,
            xray: xray.clone(),
            phantom: phantom.clone(),
        });
        Ok(phantom)
    }
}

/// Whether [`SceneSetup::of_plan`] gives the same for both.
fn same_setup(a: &Plan, b: &Plan) -> bool {
    let beam = |plan: &Plan| (plan.xray.kvp, plan.xray.anode_angle_deg);
    a.seed == b.seed
        && a.room == b.room
        && a.depth == b.depth
        && beam(a) == beam(b)
        && a.xray.filters == b.xray.filters
}

fn radiograph_png(radiograph: &Radiograph, xray: &XraySettings) -> Result<Vec<u8>, StudioError> {
    let grey = radiograph.present(&xray.presentation)?;
    let bytes = grey.iter().map(|value| (value >> 8) as u8).collect();
    let (columns, rows) = (radiograph.columns() as u32, radiograph.rows() as u32);
    let picture = GrayImage::from_raw(columns, rows, bytes).expect("one value for each pixel");
    png(DynamicImage::ImageLuma8(picture))
}

fn png(picture: DynamicImage) -> Result<Vec<u8>, StudioError> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}
