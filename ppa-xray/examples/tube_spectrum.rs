//! Half-value layers of a tungsten tube at several voltages, and the transmission of 10 cm of water.
//!
//! `cargo run -p ppa-xray --example tube_spectrum`

use std::error::Error;

use ppa_xray::{Material, Spectrum, TubeSpec};

fn main() -> Result<(), Box<dyn Error>> {
    let water = Material::named("water")?;
    for kvp in [50.0, 60.0, 80.0, 120.0] {
        let spectrum = Spectrum::tungsten(&TubeSpec::new(kvp, 12.0, vec!["Al:2.5".parse()?]))?;
        let mean_kev = spectrum.mean_energy_kev();
        let attenuation = water.total_cm2_g(mean_kev)? * water.density_g_cm3();
        println!(
            "{kvp:3} kVp: {:.2} mm Al, mean {mean_kev:.1} keV, of which 10 cm of water pass {:.1} %",
            spectrum.hvl1_mm_al(),
            100.0 * (-10.0 * attenuation).exp()
        );
    }
    Ok(())
}
