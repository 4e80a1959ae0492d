//! The backbone as one candle operation, so that `backward()` gives gradients of losses on its features.

use std::sync::{Arc, Mutex, PoisonError};

use candle_core::{CpuStorage, CustomOp2, Error, Layout, Result, Shape, Tensor, Var};

use super::architecture::{Architecture, FEATURES};
use super::backward::Backward;
use super::folded::Folded;
use super::forward::Forward;
use super::inference::Inference;
use super::tape::{Size, Tape};
use super::{EfficientNetB0, Mode};
use crate::kernels::buffer::Pool;
use crate::random::{Purpose, stream};

/// One run of the backbone: (images, parameters) to features.
pub struct Backbone {
    architecture: Arc<Architecture>,
    statistics: Var,
    pool: Pool,
    folded: Option<Arc<Folded>>,
    seed: u64,
    mode: Mode,
    tape: Mutex<Option<Tape>>,
}

impl Backbone {
    pub fn new(network: &EfficientNetB0, mode: Mode) -> Self {
        Self {
            architecture: network.architecture.clone(),
            statistics: network.statistics.clone(),
            pool: network.pool.clone(),
            folded: network.folded.clone(),
            seed: network.seed,
            mode,
            tape: Mutex::new(None),
        }
    }
}

/// Returns the values of a contiguous tensor.
fn values<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let (start, end) = layout.contiguous_offsets().ok_or_else(|| {
        Error::RequiresContiguous {
            op: "efficientnet-b0",
        }
        .bt()
    })?;
    Ok(&storage.as_slice::<f32>()?[start..end])
}

impl CustomOp2 for Backbone {
    fn name(&self) -> &'static str {
        "efficientnet-b0"
    }

    fn cpu_fwd(
        &self,
        images: &CpuStorage,
        images_layout: &Layout,
        parameters: &CpuStorage,
        layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (count, _, height, width) = images_layout.shape().dims4()?;
        let size = Size {
            images: count,
            height,
            width,
        };
        let mut statistics = self.statistics.to_vec1::<f32>()?;
        let (images, parameters) = (values(images, images_layout)?, values(parameters, layout)?);
        let features = match self.mode {
            Mode::Train { .. } | Mode::Statistics { .. } => {
                let step = self.mode.dropout_step();
                let mut random = step.map(|step| stream(self.seed, Purpose::Dropout, 2 * step));
                let forward = Forward {
                    architecture: &self.architecture,
                    parameters,
                    statistics: &mut statistics,
                    pool: &self.pool,
                    momentum: self.mode.momentum(),
                    random: random.as_mut().map(|random| random as &mut dyn rand::Rng),
                    blocks: Vec::new(),
                };
                let (features, tape) = forward.run(images, size);
                self.statistics
                    .set(&Tensor::new(statistics, self.statistics.device())?)?;
                *self.tape.lock().unwrap_or_else(PoisonError::into_inner) = Some(tape);
                features
            }
            Mode::Eval => {
                let (architecture, pool) = (&self.architecture, &self.pool);
                let folded = match &self.folded {
                    Some(folded) => folded.clone(),
                    None => Folded::new(architecture, parameters, &statistics, pool).into(),
                };
                let inference = Inference {
                    architecture,
                    folded: &folded,
                    parameters,
                    pool,
                };
                inference.run(images, size)
            }
        };
        Ok((CpuStorage::F32(features), (count, FEATURES).into()))
    }

    /// Computes the gradient of the parameters. Images have none because nothing before them is trained.
    fn bwd(
        &self,
        _: &Tensor,
        parameters: &Tensor,
        _: &Tensor,
        of_features: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let tape = self
            .tape
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let Some(tape) = tape else {
            return Err(Error::msg(
                "efficientnet-b0 has a gradient once, and only after a pass in training mode",
            )
            .bt());
        };
        let of_features = of_features.flatten_all()?.to_vec1::<f32>()?;
        let mut gradients = vec![0.0; parameters.elem_count()];
        let (storage, layout) = parameters.storage_and_layout();
        let candle_core::Storage::Cpu(storage) = &*storage else {
            return Err(Error::msg("efficientnet-b0 runs on the CPU").bt());
        };
        let backward = Backward {
            architecture: &self.architecture,
            parameters: values(storage, layout)?,
            gradients: &mut gradients,
            pool: &self.pool,
        };
        backward.run(tape, &of_features);
        let gradients = Tensor::from_vec(gradients, parameters.shape(), parameters.device())?;
        Ok((None, Some(gradients)))
    }
}
