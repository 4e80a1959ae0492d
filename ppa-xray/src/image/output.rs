//! Image files of radiographs: 16-bit PNG for viewing, EXR with every layer for computing.

use std::{
    io::Cursor,
    path::{Path, PathBuf},
};

use ::exr::prelude::{self as exr, WritableImage};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use ppa_core::whole_file;

use crate::image::presentation::{Presentation, PresentationError};
use crate::image::radiograph::{Engine, Radiograph};
use crate::transport::tally::Category;

/// Why an image file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file could not be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// The PNG encoder failed.
    #[error("cannot encode {} as PNG", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// Error of the encoder.
        source: image::ImageError,
    },
    /// The EXR encoder failed.
    #[error("cannot encode {} as EXR", path.display())]
    Exr {
        /// The file.
        path: PathBuf,
        /// Error of the encoder.
        source: exr::Error,
    },
    /// The DICOM encoder failed.
    #[cfg(feature = "dicom")]
    #[error("cannot encode {} as DICOM", path.display())]
    Dicom {
        /// The file.
        path: PathBuf,
        /// Error of the encoder.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The image has more pixels than DICOM can represent.
    #[cfg(feature = "dicom")]
    #[error("a DICOM image has at most 65535 columns and rows, this one has {columns} x {rows}")]
    DicomSize {
        /// Columns of the image.
        columns: u32,
        /// Rows of the image.
        rows: u32,
    },
    /// The receptor is invalid.
    #[cfg(feature = "dicom")]
    #[error(transparent)]
    Receptor(#[from] crate::beam::receptor::ReceptorError),
    /// The presentation is invalid.
    #[error(transparent)]
    Presentation(#[from] PresentationError),
}

/// Name of the EXR attribute that holds the metadata, as `key = value` lines (TOML).
///
/// There is only one: the encoder keeps further attributes in a hash map, whose order changes from run to run.
pub const EXR_ATTRIBUTE: &str = "ppaXray";

impl Radiograph {
    /// Writes the presentation image as 16-bit grey PNG. The file is written completely or not at all.
    ///
    /// # Errors
    /// [`OutputError`] naming the file.
    pub fn write_png(&self, path: &Path, presentation: &Presentation) -> Result<(), OutputError> {
        let grey = self.present(presentation)?;
        let bytes: Vec<u8> = grey.iter().flat_map(|v| v.to_ne_bytes()).collect();
        let mut encoded = Vec::new();
        PngEncoder::new(&mut encoded)
            .write_image(
                &bytes,
                self.detector.columns,
                self.detector.rows,
                ExtendedColorType::L16,
            )
            .map_err(|source| OutputError::Png {
                path: path.into(),
                source,
            })?;
        write_whole(path, &encoded)
    }

    /// Writes all layers as 32-bit EXR. The file is written completely or not at all.
    ///
    /// Channels: `Y`, the total, and per [`Category`] `<name>.value` and `<name>.sigma`, eV/cm² per history; with electronic
    /// noise `electronic.value` and `electronic.sigma`.
    /// The attribute [`EXR_ATTRIBUTE`] holds seed, histories, units, geometry and exposure. The bytes depend only on the
    /// radiograph.
    ///
    /// # Errors
    /// [`OutputError`] naming the file.
    pub fn write_exr(&self, path: &Path) -> Result<(), OutputError> {
        self.check_layers()?;
        let mut channels = exr::SmallVec::new();
        let mut add = |name: &str, samples: Vec<f32>| {
            channels.push(exr::AnyChannel::new(name, exr::FlatSamples::F32(samples)));
        };
        add("Y", self.total());
        for category in Category::ALL {
            let layer = self.layer(category);
            add(&format!("{}.value", category.name()), layer.value.clone());
            add(&format!("{}.sigma", category.name()), layer.sigma.clone());
        }
        if let Some(layer) = &self.electronic {
            add("electronic.value", layer.value.clone());
            add("electronic.sigma", layer.sigma.clone());
        }
        let mut attributes = exr::LayerAttributes::default();
        attributes.other.insert(
            exr::Text::from(EXR_ATTRIBUTE),
            exr::AttributeValue::Text(exr::Text::from(self.describe().as_str())),
        );
        let layer = exr::Layer::new(
            (self.columns(), self.rows()),
            attributes,
            exr::Encoding::SMALL_LOSSLESS,
            exr::AnyChannels::sort(channels),
        );
        let mut encoded = Cursor::new(Vec::new());
        exr::Image::from_layer(layer)
            .write()
            .non_parallel()
            .to_buffered(&mut encoded)
            .map_err(|source| OutputError::Exr {
                path: path.into(),
                source,
            })?;
        write_whole(path, &encoded.into_inner())
    }

    fn describe(&self) -> String {
        let engine = match self.engine {
            Engine::Analog => "analog",
            Engine::Fast => "fast",
        };
        let [x_mm, y_mm] = self.detector.centre_mm;
        let mut text = format!(
            "engine = \"{engine}\"\nseed = {}\nhistories = {:e}\nunit = \"eV/cm2 per history\"\n\
             pixel_mm = {}\ndetector_centre_mm = [{x_mm:?}, {y_mm:?}]\nsource_detector_mm = {}\n\
             open_field_ev_cm2 = {}\n",
            self.seed,
            self.histories,
            self.detector.pixel_mm,
            self.source_detector_mm,
            self.open_field_ev_cm2,
        );
        if let Some(per_mas) = self.histories_per_mas {
            text += &format!("histories_per_mas = {per_mas:e}\n");
        }
        if let Some(mas) = self.mas().filter(|mas| mas.is_finite()) {
            text += &format!("mas = {mas:e}\n");
        }
        text
    }
}

/// Calls [`whole_file::write`] and converts its error.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    whole_file::write(path, bytes).map_err(|source| OutputError::Write {
        path: path.into(),
        source,
    })
}
