//! OpenEXR with exact depths.

use std::io;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text,
    WritableImage,
};

use ppa_core::whole_file;

use crate::image::{DepthError, DepthImage};

impl DepthImage {
    /// Writes an OpenEXR file with one f32 channel `Z` in mm, 0 for nothing, atomically.
    ///
    /// # Errors
    /// [`DepthError::Write`] names the file; [`DepthError::Length`] for a buffer that does not fit the size.
    pub fn write_exr(&self, path: &Path) -> Result<(), DepthError> {
        self.check_length()?;
        let channel = AnyChannel::new("Z", FlatSamples::F32(self.z_mm.clone()));
        let mut attributes = LayerAttributes::named("depth");
        attributes.comments = Some(Text::from(
            "Z: depth along the optical axis in mm, 0 = nothing",
        ));
        let size = (self.width as usize, self.height as usize);
        let channels = AnyChannels::sort([channel].into_iter().collect());
        // Scan lines in order: other encodings let threads order the blocks, and the bytes of the file would vary.
        let image = Image::from_layer(Layer::new(
            size,
            attributes,
            Encoding::SMALL_LOSSLESS,
            channels,
        ));
        whole_file::write_with(path, |writer| {
            image
                .write()
                .to_buffered(writer)
                .map_err(|error| match error {
                    exr::error::Error::Io(source) => source,
                    other => io::Error::other(other),
                })
        })
        .map_err(|source| DepthError::Write {
            path: path.into(),
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers, read};

    #[test]
    fn an_exr_holds_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.exr");
        let z_mm: Vec<f32> = (0..35).map(|i| 1000.0 / (i as f32 + 0.3)).collect();
        let image = DepthImage {
            width: 7,
            height: 5,
            z_mm,
        };
        image.write_exr(&path).unwrap();
        let back = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes();
        let back = back.from_file(&path).unwrap().layer_data;
        let channel = &back.channel_data.list[0];
        assert_eq!(
            (back.size.0, back.size.1, channel.name.to_string()),
            (7, 5, "Z".into())
        );
        assert_eq!(
            channel.sample_data.values_as_f32().collect::<Vec<_>>(),
            image.z_mm
        );
        assert!(matches!(
            image.write_exr(&folder.path().join("a/b.exr")),
            Err(DepthError::Write { .. })
        ));
    }

    #[test]
    fn the_same_image_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.exr");
        let mut image = DepthImage::empty(512, 512);
        for (i, z_mm) in image.z_mm.iter_mut().enumerate() {
            *z_mm = if i % 700 < 400 {
                (i as f32).sqrt()
            } else {
                0.0
            };
        }
        let bytes = || {
            image.write_exr(&path).unwrap();
            std::fs::read(&path).unwrap()
        };
        let first = bytes();
        assert!((0..10).all(|_| bytes() == first));
    }
}
