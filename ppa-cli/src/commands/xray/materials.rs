//! `ppa xray materials`: mass attenuation of a material.

use clap::Args;
use ppa_xray::Material;
use serde::Serialize;

use crate::output::Output;

#[derive(Debug, Args)]
pub struct MaterialsArgs {
    /// A named material; without one, all are listed
    #[arg(long, conflicts_with = "composition")]
    material: Option<String>,
    /// Mass fractions by element, as "Ca:0.4,C:0.12,O:0.48"
    #[arg(long)]
    composition: Option<String>,
    /// Density in g/cm³ of a composition
    #[arg(long, default_value_t = 1.0, conflicts_with = "material")]
    density: f64,
    /// Photon energy in keV
    #[arg(long, default_value_t = 60.0)]
    energy_kev: f64,
}

#[derive(Debug, Serialize)]
struct Attenuation {
    material: String,
    density_g_cm3: f64,
    energy_kev: f64,
    photoelectric_cm2_g: f64,
    rayleigh_cm2_g: f64,
    compton_cm2_g: f64,
    total_cm2_g: f64,
}

#[derive(Debug, Serialize)]
struct Known {
    materials: Vec<&'static str>,
    library: Vec<Described>,
}

#[derive(Debug, Serialize)]
struct Described {
    name: &'static str,
    density_g_cm3: f64,
    composition: String,
    source: Option<&'static str>,
}

impl Described {
    fn new(name: &'static str) -> anyhow::Result<Self> {
        let material = Material::named(name)?;
        Ok(Self {
            name,
            density_g_cm3: material.density_g_cm3(),
            composition: material.composition(),
            source: Material::source_of(name),
        })
    }
}

pub fn run(args: &MaterialsArgs, output: Output) -> anyhow::Result<()> {
    let material = match (&args.material, &args.composition) {
        (Some(name), _) => Material::named(name)?,
        (None, Some(text)) => Material::parse_composition("composition", args.density, text)?,
        (None, None) => {
            let known = Known {
                materials: Material::names().collect(),
                library: Material::names()
                    .map(Described::new)
                    .collect::<anyhow::Result<_>>()?,
            };
            return output.print(&known, |known| {
                let line = |m: &Described| {
                    format!(
                        "{:<22}{:>10} g/cm³  {}",
                        m.name, m.density_g_cm3, m.composition
                    )
                };
                known
                    .library
                    .iter()
                    .map(line)
                    .collect::<Vec<_>>()
                    .join("\n")
            });
        }
    };
    let energy_kev = args.energy_kev;
    let attenuation = Attenuation {
        material: material.name().to_owned(),
        density_g_cm3: material.density_g_cm3(),
        energy_kev,
        photoelectric_cm2_g: material.photoelectric_cm2_g(energy_kev)?,
        rayleigh_cm2_g: material.rayleigh_cm2_g(energy_kev)?,
        compton_cm2_g: material.compton_cm2_g(energy_kev)?,
        total_cm2_g: material.total_cm2_g(energy_kev)?,
    };
    output.print(&attenuation, |a| {
        format!(
            "{} ({} g/cm³) at {} keV, cm²/g: photoelectric {:.5e}, Rayleigh {:.5e}, Compton {:.5e}, total {:.5e}",
            a.material,
            a.density_g_cm3,
            a.energy_kev,
            a.photoelectric_cm2_g,
            a.rayleigh_cm2_g,
            a.compton_cm2_g,
            a.total_cm2_g
        )
    })
}
