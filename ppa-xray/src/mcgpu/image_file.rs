//! Images in the format of MC-GPU: a text file and a raw file.

use std::fmt::Write;
use std::path::Path;

use crate::image::output::write_whole;
use crate::image::radiograph::{Engine, Radiograph};
use crate::mcgpu::error::McgpuError;
use crate::mcgpu::simulation::Simulation;
use crate::mcgpu::trajectory::Station;
use crate::transport::tally::Category;

/// Energy per pixel in the order of MC-GPU: columns first, then rows from low to high z.
#[derive(Debug, Clone, PartialEq)]
pub struct McgpuImage {
    /// Pixels along columns and rows.
    pub pixels: [usize; 2],
    /// Non-scattered, single Compton, single Rayleigh, multiple; eV/cm² per history.
    pub planes: [Vec<f32>; 4],
}

impl McgpuImage {
    /// Flips the rows of a radiograph and averages its square pixels over those of MC-GPU, each of `per_pixel` columns and
    /// rows.
    pub(crate) fn new(radiograph: &Radiograph, per_pixel: [u32; 2]) -> Self {
        let [across, along] = per_pixel.map(|n| n as usize);
        let (columns, rows) = (radiograph.columns() / across, radiograph.rows() / along);
        let share = 1.0 / (across * along) as f64;
        let planes = Category::ALL.map(|category| {
            let fine = &radiograph.layer(category).value;
            let mut plane = Vec::with_capacity(columns * rows);
            for row in (0..rows).rev() {
                for column in 0..columns {
                    let parts = (row * along..(row + 1) * along)
                        .map(|row| row * radiograph.columns() + column * across)
                        .flat_map(|first| &fine[first..first + across]);
                    plane.push((parts.map(|&v| f64::from(v)).sum::<f64>() * share) as f32);
                }
            }
            plane
        });
        Self {
            pixels: [columns, rows],
            planes,
        }
    }

    /// Sum of all categories per pixel.
    pub fn total(&self) -> Vec<f32> {
        let [primary, compton, rayleigh, multiple] = &self.planes;
        primary
            .iter()
            .zip(compton)
            .zip(rayleigh.iter().zip(multiple))
            .map(|((p, c), (r, m))| p + c + r + m)
            .collect()
    }

    /// Five planes of little-endian 32-bit floats: the total, then the four categories.
    fn raw(&self) -> Vec<u8> {
        let total = self.total();
        let planes = std::iter::once(&total).chain(&self.planes);
        planes.flatten().flat_map(|v| v.to_le_bytes()).collect()
    }

    /// The four planes as text columns; a blank line ends each row.
    fn text(&self, header: &str, footer: &str) -> String {
        let mut text = header.to_owned();
        let [primary, compton, rayleigh, multiple] = &self.planes;
        for pixel in 0..primary.len() {
            writeln!(
                text,
                "{:.8} {:.8} {:.8} {:.8}",
                primary[pixel], compton[pixel], rayleigh[pixel], multiple[pixel]
            )
            .expect("strings take everything");
            if (pixel + 1) % self.pixels[0] == 0 {
                text.push('\n');
            }
        }
        text + footer
    }
}

impl Simulation {
    /// A radiograph of one of [`Input::stations`](crate::mcgpu::Input::stations) in the pixel order of MC-GPU.
    pub fn image(&self, radiograph: &Radiograph) -> McgpuImage {
        McgpuImage::new(radiograph, self.square_pixels())
    }

    /// Name of the image file of a projection. With several projections, four digits of the number are appended.
    pub fn image_name(&self, station: &Station) -> String {
        let name = &self.input().image_file;
        if self.input().trajectory.projections == 1 {
            name.clone()
        } else {
            format!("{name}_{:04}", station.number)
        }
    }

    /// Names of the two files of a projection: text, then raw.
    pub fn image_names(&self, station: &Station) -> [String; 2] {
        let name = self.image_name(station);
        let raw = format!("{name}.raw");
        [name, raw]
    }

    /// Names of all files written by a scan of these projections: images, and voxel doses if the input file requests them.
    pub fn file_names(&self, stations: &[Station]) -> Vec<String> {
        let mut names: Vec<String> = stations
            .iter()
            .flat_map(|station| self.image_names(station))
            .collect();
        if let (Some(asked), Some(_)) = (&self.input().voxel_dose, self.dose_box()) {
            let name = &asked.file;
            names.extend([
                name.clone(),
                format!("{name}.raw"),
                format!("{name}_PercentRelError2sigma.raw"),
            ]);
        }
        names
    }

    /// Writes the image of a projection into `folder`, as text under [`Simulation::image_name`] and as 32-bit floats
    /// with `.raw` appended to the name. Each file is written completely or not at all.
    ///
    /// Scripts made for MC-GPU can read them: text with four columns (non-scattered, Compton, Rayleigh, multiple) in eV/cm²
    /// per history and a blank line after each row; raw with five planes, the total first. Run times are omitted, so
    /// the same seed gives the same bytes.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_image(
        &self,
        folder: &Path,
        station: &Station,
        radiograph: &Radiograph,
    ) -> Result<(), McgpuError> {
        for (name, bytes) in self.image_files(station, radiograph) {
            write_whole(&folder.join(name), &bytes)?;
        }
        Ok(())
    }

    /// Names and contents of the files that [`Simulation::write_image`] writes.
    pub(crate) fn image_files(
        &self,
        station: &Station,
        radiograph: &Radiograph,
    ) -> [(String, Vec<u8>); 2] {
        let image = self.image(radiograph);
        let text = image.text(
            &self.header(station, radiograph),
            &self.footer(&image, radiograph),
        );
        let [name, raw_name] = self.image_names(station);
        [(name, text.into_bytes()), (raw_name, image.raw())]
    }

    fn header(&self, station: &Station, radiograph: &Radiograph) -> String {
        let input = self.input();
        let engine = match radiograph.engine {
            Engine::Analog => "analog",
            Engine::Fast => "fast",
        };
        let mut text = format!(
            "# \n#  Image in the layout of MC-GPU v1.3, by the {engine} engine of ppa-xray\n# \n\
             #  Pixel value units: eV/cm^2 per history (energy fluence), ideal energy integrating detector.\n"
        );
        if input.trajectory.projections > 1 {
            let (number, projections) = (station.number + 1, input.trajectory.projections);
            let angle_deg = station.angle_deg;
            text += &format!(
                "#  CT projection {number} of {projections}: angle from X axis = {angle_deg:.6} \n"
            );
        }
        let vector = |[x, y, z]: [f64; 3]| format!("({x:.8},{y:.8},{z:.8})");
        let [width, height] = [0, 1].map(|i| input.detector_cm[i] / f64::from(input.pixels[i]));
        text + &format!(
            "#  Focal spot position = {}, cone beam direction = {}\n\
             #  Pixel size:  {width:.6} x {height:.6} = {:.6} cm^2\n\
             #  Number of pixels in X and Z:  {}  {}\n\
             #  (X rows given first, a blank line separates the different Z values)\n# \n\
             #  [NON-SCATTERED] [COMPTON] [RAYLEIGH] [MULTIPLE-SCATTING]\n\
             # ==========================================================\n",
            vector(station.source_cm.coords.into()),
            vector(station.direction.into_inner().into()),
            width * height,
            input.pixels[0],
            input.pixels[1],
        )
    }

    fn footer(&self, image: &McgpuImage, radiograph: &Radiograph) -> String {
        let total = image.total();
        let (pixel, value) = total
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .expect("a detector has pixels");
        let sums = &radiograph.sums;
        let share = 1e-3 * sums.total_ev_per_history() / self.spectrum().mean_energy_kev();
        format!(
            "#   *** Simulation REPORT: ***\n\
             #       Fraction of energy detected (over the mean energy of the spectrum): {:.3}%\n\
             #       Maximum energy detected in pixel {pixel}: (x,y)=({},{}) -> pixel value = {value:.6} eV/cm^2\n\
             #       Simulated x rays:    {}\n",
            100.0 * share,
            pixel % image.pixels[0],
            pixel / image.pixels[0],
            radiograph.histories,
        )
    }
}
