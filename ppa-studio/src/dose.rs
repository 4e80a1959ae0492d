//! Absorbed dose of an exposure, from analog histories.

use std::ops::ControlFlow;

use ppa_core::Part;
use ppa_generate::ExposableLimb;
use ppa_xray::{AnalogRun, AnalogSettings, DoseSettings, Imparted, Stop, Stopped};
use serde::Serialize;

use crate::error::StudioError;
use crate::newest::Ticket;

/// Number of simulated histories.
pub(crate) const HISTORIES: u64 = 2_000_000;

/// Absorbed dose in the part of the limb that radiographs are computed from.
#[derive(Debug, Serialize)]
pub(crate) struct DoseReport {
    histories: u64,
    /// Photons per mAs, if the fluence of the spectrum is known.
    histories_per_mas: Option<f64>,
    /// Dose of all voxels, including the air around the limb, then of each kind of matter except air.
    matter: Vec<MatterDose>,
}

#[derive(Debug, Serialize)]
struct MatterDose {
    name: String,
    mass_g: f64,
    gy_per_history: f64,
    /// Standard error.
    gy_per_history_se: f64,
}

impl MatterDose {
    /// Adds standard errors in quadrature: nearly all photons deposit their energy in one of the mixtures.
    fn new(name: &str, mixtures: &[Imparted]) -> Self {
        let sum = |of: fn(&Imparted) -> f64| mixtures.iter().map(of).sum::<f64>();
        let mut whole = mixtures[0];
        whole.mass_g = sum(|part| part.mass_g);
        whole.ev_per_history.value = sum(|part| part.ev_per_history.value);
        whole.ev_per_history.se = sum(|part| part.ev_per_history.se.powi(2)).sqrt();
        let dose = whole.gy_per_history();
        Self {
            name: name.to_owned(),
            mass_g: whole.mass_g,
            gy_per_history: dose.value,
            gy_per_history_se: dose.se,
        }
    }
}

/// Groups mixtures of the same materials: their names differ only after a comma.
fn by_matter(materials: &[(String, Imparted)]) -> Vec<(&str, Vec<Imparted>)> {
    let mut groups: Vec<(&str, Vec<Imparted>)> = Vec::new();
    for (name, imparted) in materials {
        let name = name.split(',').next().unwrap_or_default();
        if name == "air" || imparted.mass_g == 0.0 {
            continue;
        }
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, mixtures)) => mixtures.push(*imparted),
            None => groups.push((name, vec![*imparted])),
        }
    }
    groups
}

/// Simulates the histories until a later request replaces this one.
pub(crate) fn absorbed_dose(
    limb: &ExposableLimb,
    angle_deg: f64,
    seed: u64,
    ticket: &Ticket,
) -> Result<DoseReport, StudioError> {
    let exposure = limb.pose(angle_deg.to_radians())?;
    let settings = AnalogSettings::default()
        .with_histories(HISTORIES)
        .with_seed(seed);
    let phantom = limb.phantom.phantom();
    let run = AnalogRun::new(phantom, &limb.spectrum, &exposure.projection, &settings)?;
    let run = run.with_dose(&DoseSettings::default())?;
    let mut tally = run.tally(Part::WHOLE);
    let ended = run.follow(&mut tally, &Stop::default(), |_, _| {
        if ticket.is_newest() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    })?;
    if ended == Stopped::Interrupted {
        return Err(StudioError::Superseded);
    }
    let dose = tally.dose().expect("the run counts doses");
    let mut matter = vec![MatterDose::new("all voxels", &[dose.phantom])];
    let groups = by_matter(&dose.materials).into_iter();
    matter.extend(groups.map(|(name, mixtures)| MatterDose::new(name, &mixtures)));
    Ok(DoseReport {
        histories: dose.histories,
        histories_per_mas: dose.histories_per_mas,
        matter,
    })
}
