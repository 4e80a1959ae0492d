//! `ppa xray spectrum`: the beam of a tungsten tube behind filters.

use clap::Args;
use ppa_generate::{XraySettings, spectrum};
use serde::Serialize;

use super::BeamArgs;
use crate::output::Output;

#[derive(Debug, Args)]
pub struct SpectrumArgs {
    #[command(flatten)]
    beam: BeamArgs,
}

#[derive(Debug, Serialize)]
struct Beam {
    mean_energy_kev: f64,
    hvl1_mm_al: f64,
    hvl2_mm_al: f64,
    fluence_per_mas_cm2_at_1m: Option<f64>,
    kerma_ugy_per_mas_at_1m: Option<f64>,
}

pub fn run(args: &SpectrumArgs, output: Output) -> anyhow::Result<()> {
    let mut settings = XraySettings::default();
    args.beam.apply(&mut settings);
    let spectrum = spectrum(&settings)?;
    let beam = Beam {
        mean_energy_kev: spectrum.mean_energy_kev(),
        hvl1_mm_al: spectrum.hvl1_mm_al(),
        hvl2_mm_al: spectrum.hvl2_mm_al(),
        fluence_per_mas_cm2_at_1m: spectrum.fluence_per_mas_cm2_at_1m(),
        kerma_ugy_per_mas_at_1m: spectrum.kerma_ugy_per_mas_at_1m(),
    };
    output.print(&beam, |beam| {
        let mut text = format!(
            "mean energy {:.2} keV, HVL1 {:.3} mm Al, HVL2 {:.3} mm Al",
            beam.mean_energy_kev, beam.hvl1_mm_al, beam.hvl2_mm_al
        );
        if let (Some(fluence), Some(kerma)) =
            (beam.fluence_per_mas_cm2_at_1m, beam.kerma_ugy_per_mas_at_1m)
        {
            text += &format!("; at 1 m {fluence:.4e} photons/(mAs cm²), {kerma:.2} µGy/mAs");
        }
        text
    })
}
