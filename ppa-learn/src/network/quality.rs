//! The network that is trained: for one camera's images, or for both cameras' images of one moment.

use candle_core::{Device, Tensor, Var};
use rand::Rng;

use super::architecture::Entry;
use super::fusion::{Fusion, FusionKind, LATE_OUTPUTS, LateFusion, branch_gains};
use super::{EfficientNetB0, Mode, Named, NetworkError, Options};
use crate::random::{Purpose, stream};

/// A network that predicts the quality of a pose, and optionally the correction, from the images of one camera or of both.
///
/// Its tensors have the names of the authors' modules: torchvision's for one camera; prefixed by `module.` if both cameras share
/// the weights, otherwise by `cam_left_module.` and `cam_right_module.`; `fc.0` and `fc.3` for the layers of late fusion.
#[derive(Debug, Clone)]
pub struct QualityNetwork {
    /// One network, or the left and the right camera's.
    branches: Vec<EfficientNetB0>,
    fusion: Option<Fusion>,
    late: Option<LateFusion>,
    targets: Targets,
    seed: u64,
}

/// Degrees per unit of a network's second output, which gives corrections the magnitude of labels.
pub const CORRECTION_UNIT_DEG: f64 = 30.0;

/// Targets that a network predicts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Targets {
    /// The quality of a pose: the paper's network.
    #[default]
    Quality,
    /// Also the correction: the medial rotation from a pose to the best one of the limb.
    QualityAndCorrection,
}

impl Targets {
    /// Returns the number of outputs for each moment.
    pub(crate) fn outputs(self) -> usize {
        match self {
            Self::Quality => 1,
            Self::QualityAndCorrection => 2,
        }
    }
}

/// Prediction of a network for a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosePrediction {
    /// Quality from 1 (ideal) to 3 (inadequate).
    pub quality: f64,
    /// Medial rotation in degrees that would bring the limb into its best pose; lateral if negative.
    pub correction_deg: Option<f64>,
}

impl PosePrediction {
    /// Makes a prediction of the quality without a correction.
    pub fn of_quality(quality: f64) -> Self {
        Self {
            quality,
            correction_deg: None,
        }
    }

    /// Converts a network's outputs [moments, 1 or 2] to predictions.
    pub(crate) fn of(outputs: &Tensor) -> Result<Vec<Self>, NetworkError> {
        let rows = outputs.to_vec2::<f32>()?;
        let prediction = |row: &Vec<f32>| Self {
            quality: row[0].into(),
            correction_deg: row
                .get(1)
                .map(|&units| CORRECTION_UNIT_DEG * f64::from(units)),
        };
        Ok(rows.iter().map(prediction).collect())
    }
}

/// Prefixes of the tensor names of each camera's network.
pub(crate) const CAMERA_PREFIXES: [&str; 2] = ["cam_left_module.", "cam_right_module."];

/// Name and position of a parameter or a running statistic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Index of the flat variable.
    pub variable: usize,
    /// Name, shape and range in the variable.
    pub entry: Entry,
}

impl QualityNetwork {
    /// Makes a network for `targets` with initial values as in [`EfficientNetB0::new`]; for both cameras if `fusion` is given.
    ///
    /// # Errors
    /// If candle cannot make the variables.
    pub fn new(
        seed: u64,
        options: Options,
        fusion: Option<Fusion>,
        targets: Targets,
    ) -> Result<Self, NetworkError> {
        let kind = fusion.map(|fusion| fusion.kind);
        let outputs = match kind {
            Some(FusionKind::Late) => LATE_OUTPUTS,
            _ => targets.outputs(),
        };
        let branch = |seed| EfficientNetB0::with_outputs(seed, options, outputs);
        let branches = match fusion {
            Some(fusion) if !fusion.shared_weights => [0, 1]
                .map(|camera| branch(stream(seed, Purpose::Branches, camera).next_u64()))
                .into_iter()
                .collect::<Result<_, _>>()?,
            _ => vec![branch(seed)?],
        };
        let late = match fusion {
            Some(fusion) if fusion.kind == FusionKind::Late => {
                let outputs = targets.outputs();
                Some(LateFusion::new(seed, fusion.late_dropout, outputs)?)
            }
            _ => None,
        };
        Ok(Self {
            branches,
            fusion,
            late,
            targets,
            seed,
        })
    }

    /// Combines the networks of the left and the right camera into one that predicts the mean of both, as the paper does for a pose. It
    /// shares its variables with them.
    ///
    /// # Errors
    /// If one of them takes the images of both cameras, or only one predicts corrections.
    pub fn averaged(left: &Self, right: &Self) -> Result<Self, NetworkError> {
        let mut branches = Vec::new();
        for network in [left, right] {
            let (found, expected) = (1, network.cameras());
            if expected != found {
                return Err(NetworkError::Cameras { found, expected });
            }
            branches.extend(network.branches.iter().cloned());
        }
        if left.targets != right.targets {
            return Err(NetworkError::Targets);
        }
        Ok(Self {
            branches,
            fusion: Some(Fusion::default()),
            late: None,
            targets: left.targets,
            seed: left.seed,
        })
    }

    /// Sets the weights of the last layers to 0, such that every prediction is `quality` with a correction of 0.
    ///
    /// # Errors
    /// If candle cannot set the variables.
    pub(crate) fn begin_with(&self, quality: f32) -> Result<(), NetworkError> {
        let branches = self
            .branches
            .iter()
            .map(|branch| (branch.variables()[1], 0));
        let last: Vec<(&Var, usize)> = match &self.late {
            Some(late) => vec![(late.variable(), late.last_layer())],
            None => branches.collect(),
        };
        for (variable, start) in last {
            let mut values = variable.to_vec1::<f32>()?;
            values[start..].fill(0.0);
            // The biases follow the weights, that of the quality first.
            let biases = values.len() - self.targets.outputs();
            values[biases] = quality;
            variable.set(&Tensor::new(values, variable.device())?)?;
        }
        Ok(())
    }

    /// Returns the device on which the network computes and its images must be.
    pub fn device(&self) -> &Device {
        self.branches[0].device()
    }

    /// Returns a copy on another device, as [`EfficientNetB0::to_device`].
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn to_device(&self, device: &Device) -> Result<Self, NetworkError> {
        let branches = self.branches.iter().map(|branch| branch.to_device(device));
        let late = self.late.as_ref().map(|late| late.to_device(device));
        Ok(Self {
            branches: branches.collect::<Result<_, _>>()?,
            late: late.transpose()?,
            ..*self
        })
    }

    /// Returns the targets that the network predicts.
    pub fn targets(&self) -> Targets {
        self.targets
    }

    /// Returns the number of cameras whose images the network takes.
    pub fn cameras(&self) -> usize {
        if self.fusion.is_some() { 2 } else { 1 }
    }

    /// Computes quality and, if it is a target, correction in units of [`CORRECTION_UNIT_DEG`] for each moment [moments, 1 or 2], from
    /// each camera's images [moments, 1, height, width], left first.
    ///
    /// # Errors
    /// The same as [`EfficientNetB0::forward`], and for a wrong number of cameras.
    pub fn forward(&self, images: &[Tensor], mode: Mode) -> Result<Tensor, NetworkError> {
        self.classify(&self.features(images, mode)?, mode)
    }

    /// Computes the features [moments, 1280] of each camera's images.
    ///
    /// # Errors
    /// The same as [`QualityNetwork::forward`].
    pub fn features(&self, images: &[Tensor], mode: Mode) -> Result<Vec<Tensor>, NetworkError> {
        match (images, &self.branches[..]) {
            ([left, right], [of_left, of_right]) => {
                let (left, right) = rayon::join(
                    || of_left.features(left, mode),
                    || of_right.features(right, mode),
                );
                Ok(vec![left?, right?])
            }
            _ => self.of_all(images, |network, images| network.features(images, mode)),
        }
    }

    /// Applies the layers after the features of each camera.
    ///
    /// # Errors
    /// If the features have a wrong shape or a wrong number of cameras.
    pub fn classify(&self, features: &[Tensor], mode: Mode) -> Result<Tensor, NetworkError> {
        let outputs = match (features, &self.branches[..]) {
            ([left, right], [of_left, of_right]) => {
                vec![
                    of_left.classify(left, mode)?,
                    of_right.classify(right, mode)?,
                ]
            }
            _ => self.of_all(features, |network, features| {
                network.classify(features, mode)
            })?,
        };
        let Some(fusion) = self.fusion else {
            return Ok(outputs[0].clone());
        };
        let step = mode.dropout_step();
        let mut random = step.map(|step| stream(self.seed, Purpose::FusionDropout, step));
        let gains = match &mut random {
            Some(random) => branch_gains(random, fusion.branch_dropout),
            None => [1.0; 2],
        };
        let [left, right] = [0, 1].map(|camera| &outputs[camera] * gains[camera]);
        match &self.late {
            None => Ok(((left? + right?)? / 2.0)?),
            Some(late) => late.forward(&Tensor::cat(&[left?, right?], 1)?, random.as_mut()),
        }
    }

    /// Returns the results of the shared network for each camera, computed in one pass.
    fn of_all(
        &self,
        inputs: &[Tensor],
        run: impl Fn(&EfficientNetB0, &Tensor) -> Result<Tensor, NetworkError>,
    ) -> Result<Vec<Tensor>, NetworkError> {
        if inputs.len() != self.cameras() {
            return Err(NetworkError::Cameras {
                found: inputs.len(),
                expected: self.cameras(),
            });
        }
        let [one] = inputs else {
            let count = inputs[0].dim(0)?;
            let all = run(&self.branches[0], &Tensor::cat(inputs, 0)?)?;
            return Ok(vec![all.narrow(0, 0, count)?, all.narrow(0, count, count)?]);
        };
        Ok(vec![run(&self.branches[0], one)?])
    }

    /// Returns the networks of the cameras: one, or the left and the right camera's.
    pub(crate) fn branches(&self) -> &[EfficientNetB0] {
        &self.branches
    }

    pub(super) fn branches_mut(&mut self) -> &mut [EfficientNetB0] {
        &mut self.branches
    }

    pub(crate) fn late(&self) -> Option<&LateFusion> {
        self.late.as_ref()
    }

    /// Returns the prefixes of the tensor names of each of the networks.
    pub(crate) fn prefixes(&self) -> &'static [&'static str] {
        match self.fusion {
            None => &[""],
            Some(fusion) if fusion.shared_weights => &["module."],
            Some(_) => &CAMERA_PREFIXES,
        }
    }

    /// Returns the flat variables that training changes.
    pub fn variables(&self) -> Vec<&Var> {
        let branches = self.branches.iter().flat_map(EfficientNetB0::variables);
        branches
            .chain(self.late.iter().map(LateFusion::variable))
            .collect()
    }

    /// Returns the position of each parameter in [`QualityNetwork::variables`].
    pub fn layout(&self) -> Vec<Place> {
        let mut places = Vec::new();
        for (number, (branch, prefix)) in self.branches.iter().zip(self.prefixes()).enumerate() {
            places.extend(branch.layout().map(|(variable, entry)| Place {
                variable: 2 * number + variable,
                entry: named_with(prefix, entry),
            }));
        }
        let late = self.late.iter().flat_map(LateFusion::entries);
        places.extend(late.map(|entry| Place {
            variable: 2 * self.branches.len(),
            entry: entry.clone(),
        }));
        places
    }

    /// Returns the flat variables of running statistics, one for each network.
    pub fn statistics_variables(&self) -> Vec<&Var> {
        let branches = self.branches.iter();
        branches.map(EfficientNetB0::statistics_variable).collect()
    }

    /// Returns the position of each running mean and variance in [`QualityNetwork::statistics_variables`].
    pub fn statistics_layout(&self) -> Vec<Place> {
        let mut places = Vec::new();
        for (number, (branch, prefix)) in self.branches.iter().zip(self.prefixes()).enumerate() {
            places.extend(branch.statistics_layout().map(|entry| Place {
                variable: number,
                entry: named_with(prefix, entry),
            }));
        }
        places
    }

    /// Returns every parameter, then every running statistic, by name.
    ///
    /// # Errors
    /// If candle cannot copy.
    pub fn tensors(&self) -> Result<Vec<Named>, NetworkError> {
        let of = |places: Vec<Place>, variables: Vec<&Var>| -> Result<Vec<Named>, NetworkError> {
            let named = places.iter().map(|p| p.entry.of(variables[p.variable]));
            named.collect()
        };
        let mut tensors = of(self.layout(), self.variables())?;
        tensors.extend(of(self.statistics_layout(), self.statistics_variables())?);
        Ok(tensors)
    }
}

fn named_with(prefix: &str, entry: &Entry) -> Entry {
    Entry {
        name: format!("{prefix}{}", entry.name),
        ..entry.clone()
    }
}
