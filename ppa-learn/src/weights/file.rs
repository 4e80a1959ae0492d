//! Weight files: reads safetensors and PyTorch's zip files, writes safetensors.

use std::collections::hash_map::Entry::{Occupied, Vacant};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use candle_core::{DType, Device, Tensor, pickle};

use super::names::{timm_name, without_prefix};
use super::{FirstConvolution, Loaded, WeightsError, WeightsMetadata, missing, other_shape};
use crate::network::{EfficientNetB0, Named};

const FIRST: &str = "features.0.0.weight";
const CLASSIFIER: [&str; 2] = ["classifier.1.weight", "classifier.1.bias"];

impl EfficientNetB0 {
    /// Reads weights of torchvision's or timm's `efficientnet_b0` from a `.safetensors` file or a `.pth` or `.pt` file of torch 1.6 or
    /// later.
    ///
    /// A first convolution of several channels is converted to one channel according to `first`; if the file's classifier has a different
    /// number of outputs, the network keeps its own. [`Loaded`] reports both, and what else is in the file. timm's `tf_efficientnet_b0`
    /// has the same names but a different padding and normalisation: it is read without an error and gives other outputs than in timm.
    ///
    /// # Errors
    /// If the file cannot be read, or if tensors are missing, have another shape or contain invalid weights; each is named, and the
    /// network is then unchanged.
    pub fn load(&self, path: &Path, first: FirstConvolution) -> Result<Loaded, WeightsError> {
        let (loaded, tensors) = self.fit(read(path)?, first)?;
        let assigned = self.assign(&tensors);
        assigned.map_err(|error| error.in_file(path, &loaded.unused))?;
        Ok(loaded)
    }

    /// Returns the tensors of a file by torchvision's names, with the network's own values where the file has none.
    pub(super) fn fit(
        &self,
        found: HashMap<String, Tensor>,
        first: FirstConvolution,
    ) -> Result<(Loaded, HashMap<String, Tensor>), WeightsError> {
        let mut all: Vec<(String, Tensor)> = found.into_iter().collect();
        all.sort_by(|(one, _), (other, _)| one.cmp(other));
        let mut loaded = Loaded::default();
        let mut found: HashMap<String, (String, Tensor)> = HashMap::new();
        for (name, tensor) in all {
            match found.entry(without_prefix(&name).to_owned()) {
                Vacant(place) => drop(place.insert((name, tensor))),
                // The same tensor with another prefix.
                Occupied(_) => loaded.unused.push(name),
            }
        }
        let timm = found.contains_key("conv_stem.weight");
        let mut tensors = HashMap::new();
        for own in self.parameters()?.into_iter().chain(self.statistics()?) {
            let name =
                if timm { timm_name(&own.name) } else { None }.unwrap_or_else(|| own.name.clone());
            let Some((given, tensor)) = found.remove(&name) else {
                continue;
            };
            let several = own.name == FIRST
                && matches!(tensor.dims(), [32, channels, 3, 3] if *channels != 1);
            let outputs = CLASSIFIER.contains(&own.name.as_str())
                && tensor.dims()[..] != own.tensor.dims()[..];
            let differs = || other_shape(&given, tensor.dims(), own.tensor.dims());
            let taken = if several {
                if first == FirstConvolution::Fresh {
                    loaded.kept.push(differs());
                }
                loaded.first_convolution = Some(first);
                match first {
                    FirstConvolution::Fresh => own.tensor,
                    FirstConvolution::Sum => tensor.to_dtype(DType::F32)?.sum_keepdim(1)?,
                    FirstConvolution::Mean => tensor.to_dtype(DType::F32)?.mean_keepdim(1)?,
                }
            } else if outputs {
                loaded.fresh_classifier = true;
                loaded.kept.push(differs());
                own.tensor
            } else {
                tensor
            };
            tensors.insert(own.name, taken);
        }
        loaded
            .unused
            .extend(found.into_values().map(|(name, _)| name));
        let counter = |name: &String| name.ends_with("num_batches_tracked");
        loaded.unused.retain(|name| !counter(name));
        loaded.unused.sort();
        if loaded.fresh_classifier {
            // A weight without its bias, or the reverse, is not a classifier.
            for own in self
                .parameters()?
                .into_iter()
                .filter(|own| CLASSIFIER.contains(&own.name.as_str()))
            {
                if !tensors.contains_key(&own.name) {
                    loaded.kept.push(missing(&own.name));
                }
                tensors.insert(own.name, own.tensor);
            }
        }
        Ok((loaded, tensors))
    }

    /// Writes all weights and running statistics atomically as safetensors with torchvision's names.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), WeightsError> {
        let all = self.parameters()?.into_iter().chain(self.statistics()?);
        write(path, all, WeightsMetadata::default())
    }
}

/// Writes named tensors atomically.
pub(super) fn write(
    path: &Path,
    named: impl IntoIterator<Item = Named>,
    metadata: WeightsMetadata,
) -> Result<(), WeightsError> {
    let tensors = named.into_iter().map(|named| (named.name, named.tensor));
    let bytes = safetensors::serialize(tensors, None).map_err(candle_core::Error::from)?;
    let bytes = with_metadata(bytes, &metadata.entries());
    Ok(ppa_dataset::write_whole(path, &bytes)?)
}

/// Adds metadata to the header of a safetensors file, where the library would put it: the library takes a hash map, whose order varies
/// between runs.
fn with_metadata(file: Vec<u8>, entries: &BTreeMap<String, String>) -> Vec<u8> {
    if entries.is_empty() {
        return file;
    }
    // The length of the header, the header padded with spaces to a multiple of 8 bytes, the tensors.
    let (length, rest) = file.split_first_chunk().expect("a length of 8 bytes");
    let (before, tensors) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let entries = serde_json::to_string(entries).expect("strings are JSON");
    let mut header = format!("{{\"__metadata__\":{entries},").into_bytes();
    header.extend(before[1..].trim_ascii_end());
    header.resize(header.len().next_multiple_of(8), b' ');
    let length = (header.len() as u64).to_le_bytes();
    [&length, &header[..], tensors].concat()
}

/// Reads the tensors of a file, by their names in it.
pub(super) fn read(path: &Path) -> Result<HashMap<String, Tensor>, WeightsError> {
    read_any(path).map_err(|source| WeightsError::Read {
        path: path.to_owned(),
        source,
    })
}

fn read_any(
    path: &Path,
) -> Result<HashMap<String, Tensor>, Box<dyn std::error::Error + Send + Sync>> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("safetensors") => Ok(candle_core::safetensors::load_buffer(
            &ppa_core::regular_file::read(path)?,
            &Device::Cpu,
        )?),
        Some("pth" | "pt") => {
            // The archive is opened by its path, so files that would block are refused first.
            drop(ppa_core::regular_file::open(path)?);
            let tensors = pickle::read_all(path)?;
            // Training scripts store the weights next to other values.
            let tensors = if tensors.is_empty() {
                pickle::read_all_with_key(path, Some("state_dict"))?
            } else {
                tensors
            };
            Ok(tensors.into_iter().collect())
        }
        _ => Err("weights are read from .safetensors, .pth and .pt files".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_are_those_of_the_library_and_sorted() {
        let tensor = |value: f32| Tensor::new(&[value, 2.0], &Device::Cpu).unwrap();
        let tensors = || [("a", tensor(1.0)), ("b", tensor(3.0))];
        let plain = || safetensors::serialize(tensors(), None).unwrap();
        let entry = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let one = BTreeMap::from([entry("mirror", "true")]);
        let of_library = safetensors::serialize(tensors(), Some(one.clone().into_iter().collect()));
        assert_eq!(with_metadata(plain(), &one), of_library.unwrap());
        assert_eq!(with_metadata(plain(), &BTreeMap::new()), plain());
        let two = BTreeMap::from([entry("mirror", "true"), entry("correction", "\"30\"")]);
        let bytes = with_metadata(plain(), &two);
        assert!(bytes[8..].starts_with(b"{\"__metadata__\":{\"correction\":"));
        let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
        assert_eq!(*header.metadata(), Some(two.into_iter().collect()));
        let file = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(file.tensor("b").unwrap().data()[..4], 3f32.to_le_bytes());
    }
}
