//! Reading and writing of the values of networks for one camera or both.

use std::collections::HashMap;
use std::path::Path;

use candle_core::Tensor;

use super::file::{read, write};
use super::{FirstConvolution, Loaded, WeightsError, WeightsMetadata, assign, missing};
use crate::network::{CAMERA_PREFIXES, Fusion, FusionKind, LateFusion, Options, QualityNetwork};

impl QualityNetwork {
    /// Sets every parameter and running statistic by name; other names are ignored.
    ///
    /// # Errors
    /// If tensors are missing, have another shape or contain invalid weights, naming each; the network is then unchanged.
    pub fn assign(&self, tensors: &HashMap<String, Tensor>) -> Result<(), WeightsError> {
        let (layout, statistics) = (self.layout(), self.statistics_layout());
        let mut variables = self.variables();
        let first = variables.len();
        variables.extend(self.statistics_variables());
        let entries = layout.iter().map(|place| (place.variable, &place.entry));
        let statistics = statistics.iter();
        let statistics = statistics.map(|place| (first + place.variable, &place.entry));
        assign(&variables, entries.chain(statistics), tensors)
    }

    /// Makes the network that a weight file belongs to, with its weights, and with initial values of `seed` where the file has none.
    /// Metadata of safetensors states whether it predicts corrections.
    ///
    /// The kind of network follows from the names: layers that fuse both cameras' values mean late fusion, and networks of each camera
    /// mean separate weights. Score fusion with shared weights has the names of a single network with a wrapper's prefix `module.` and
    /// is taken for one; only the training configuration distinguishes them.
    ///
    /// # Errors
    /// The same as [`EfficientNetB0::load`](crate::EfficientNetB0::load).
    pub fn open(
        path: &Path,
        seed: u64,
        first: FirstConvolution,
    ) -> Result<(Self, Loaded), WeightsError> {
        let found = read(path)?;
        let by_camera = found.keys().any(|name| of_a_camera(name));
        let kind = match found.contains_key("fc.0.weight") {
            true => FusionKind::Late,
            false => FusionKind::Score,
        };
        let fusion = (by_camera || kind == FusionKind::Late).then_some(Fusion {
            kind,
            shared_weights: !by_camera,
            ..Fusion::default()
        });
        let targets = WeightsMetadata::read(path)?.targets;
        let network = Self::new(seed, Options::default(), fusion, targets)?;
        let loaded = network.fill(found, path, first)?;
        Ok((network, loaded))
    }

    /// Reads weights from a file as [`EfficientNetB0::load`](crate::EfficientNetB0::load) does. A file of one network fills the
    /// networks of both cameras, as after pretraining on a unified view; layers that fuse both then stay unchanged.
    ///
    /// # Errors
    /// The same as [`EfficientNetB0::load`](crate::EfficientNetB0::load); the network is then unchanged.
    pub fn load(&self, path: &Path, first: FirstConvolution) -> Result<Loaded, WeightsError> {
        self.fill(read(path)?, path, first)
    }

    /// Sets the values to the tensors of the file `path`.
    fn fill(
        &self,
        mut found: HashMap<String, Tensor>,
        path: &Path,
        first: FirstConvolution,
    ) -> Result<Loaded, WeightsError> {
        let mut tensors = HashMap::new();
        let mut loaded = Loaded::default();
        let late = self.late().map_or(&[][..], LateFusion::entries);
        let has_late = late.iter().any(|entry| found.contains_key(&entry.name));
        for named in self.tensors()? {
            if late.iter().any(|entry| entry.name == named.name) {
                match found.remove(&named.name) {
                    Some(tensor) => tensors.insert(named.name, tensor),
                    None if has_late => None,
                    None => {
                        loaded.kept.push(missing(&named.name));
                        tensors.insert(named.name, named.tensor)
                    }
                };
            }
        }
        let by_camera = self.branches().len() == 2 && found.keys().any(|name| of_a_camera(name));
        for (number, (branch, prefix)) in self.branches().iter().zip(self.prefixes()).enumerate() {
            let of_branch = match by_camera {
                true => of_network(&mut found, prefix),
                false => found.clone(),
            };
            let (of_branch, fitting) = branch.fit(of_branch, first)?;
            // Both cameras' networks report the same for a file of one network.
            if by_camera || number == 0 {
                let prefix = if by_camera { prefix } else { "" };
                let whole = |name| format!("{prefix}{name}");
                loaded.kept.extend(of_branch.kept.into_iter().map(whole));
                loaded
                    .unused
                    .extend(of_branch.unused.into_iter().map(whole));
                loaded.first_convolution = loaded.first_convolution.or(of_branch.first_convolution);
                loaded.fresh_classifier |= of_branch.fresh_classifier;
            }
            let fitting = fitting.into_iter();
            tensors.extend(fitting.map(|(name, tensor)| (format!("{prefix}{name}"), tensor)));
        }
        if by_camera {
            loaded.unused.extend(found.into_keys());
            loaded.unused.sort();
        }
        let assigned = self.assign(&tensors);
        assigned.map_err(|error| error.in_file(path, &loaded.unused))?;
        Ok(loaded)
    }

    /// Writes all weights and running statistics atomically as safetensors.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path, metadata: WeightsMetadata) -> Result<(), WeightsError> {
        write(path, self.tensors()?, metadata)
    }
}

/// Returns whether a tensor belongs to the left or the right camera's network.
fn of_a_camera(name: &str) -> bool {
    let mut prefixes = CAMERA_PREFIXES.iter();
    prefixes.any(|prefix| name.starts_with(prefix))
}

/// Extracts the tensors whose names begin with `prefix`, by their names without it.
fn of_network(found: &mut HashMap<String, Tensor>, prefix: &str) -> HashMap<String, Tensor> {
    let own = found.extract_if(|name, _| name.starts_with(prefix));
    own.map(|(name, tensor)| (name[prefix.len()..].to_owned(), tensor))
        .collect()
}
