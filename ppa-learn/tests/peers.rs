//! Exchange of weights with PyTorch and onnxruntime, and of scalars with TensorBoard.
//!
//! Run manually, with a Python that has torch, torchvision, onnx, onnxruntime, safetensors, numpy and tensorboard:
//! `PPA_PYTHON=python cargo test -p ppa-learn --features peers --test peers`.

#[path = "it/toy.rs"]
mod toy;

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::sync::atomic::AtomicBool;

use candle_core::{Device, Tensor};
use ppa_learn::train::{Source, TrainConfig, train};
use ppa_learn::{
    EfficientNetB0, FirstConvolution, Fusion, FusionKind, Loaded, Mode, Options, QualityNetwork,
    Targets, WeightsMetadata,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn values(network: &EfficientNetB0) -> Vec<Vec<f32>> {
    let named = network.parameters().unwrap().into_iter();
    named
        .chain(network.statistics().unwrap())
        .map(|named| named.tensor.flatten_all().unwrap().to_vec1().unwrap())
        .collect()
}

/// Runs `script` with the arguments, using the Python named by PPA_PYTHON.
fn python(script: &str, arguments: &[&std::path::Path]) {
    let program = std::env::var_os("PPA_PYTHON").expect("PPA_PYTHON names a Python");
    let out = std::process::Command::new(program)
        .arg("-c")
        .arg(script)
        .args(arguments)
        .output()
        .unwrap();
    println!("{}", String::from_utf8_lossy(&out.stdout));
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
}

/// Number of training passes after which running statistics are those of [`images`], so that predictions depend on the image.
const PASSES: u64 = 150;

/// Noise [count, 1, height, width], the same for the same number; each image of a batch has more contrast than the one before.
fn images(number: u64, (count, height, width): (usize, usize, usize)) -> Tensor {
    let random = ChaCha8Rng::seed_from_u64(number);
    let pixels = height * width;
    let noise = StandardNormal.sample_iter(random).take(count * pixels);
    let contrast = |index: usize| 0.1 * (1 + index / pixels) as f32;
    let values = noise.enumerate().map(|(i, x): (_, f32)| contrast(i) * x);
    let values: Vec<f32> = values.collect();
    Tensor::from_vec(values, (count, 1, height, width), &Device::Cpu).unwrap()
}

/// A network whose running statistics are not the initial ones, with its outputs for images of odd sides.
fn exported(folder: &std::path::Path) -> (EfficientNetB0, std::path::PathBuf) {
    let one = EfficientNetB0::new(1, Options::default()).unwrap();
    for step in 0..PASSES {
        let images = images(step, (4, 64, 64));
        one.forward(&images, Mode::Train { step }).unwrap();
    }
    let images = images(PASSES, (3, 77, 64));
    let output = one.forward(&images, Mode::Eval).unwrap();
    let path = folder.join("io.safetensors");
    let io = HashMap::from([
        ("images".to_owned(), images),
        ("quality".to_owned(), output),
    ]);
    candle_core::safetensors::save(&io, &path).unwrap();
    (one, path)
}

#[test]
fn onnxruntime_gives_the_same_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let (network, io) = exported(folder.path());
    let path = folder.path().join("network.onnx");
    network.save_onnx(&path).unwrap();
    let script = "
import sys, numpy, onnx, onnxruntime
from safetensors.numpy import load_file
onnx.checker.check_model(onnx.load(sys.argv[1]), full_check=True)
io = load_file(sys.argv[2])
quality, = onnxruntime.InferenceSession(sys.argv[1]).run(None, {'images': io['images']})
error = numpy.abs(quality - io['quality']).max() / numpy.abs(io['quality']).max()
assert numpy.ptp(io['quality']) > 1e-2, io['quality']
print('onnxruntime: largest relative error', error, 'of', io['quality'].ravel())
assert error < 1e-4
";
    python(script, &[&path, &io]);
}

/// Three images of each camera, of some widths.
fn pair(number: u64, [left, right]: [usize; 2]) -> [Tensor; 2] {
    [
        images(number, (3, 64, left)),
        images(number + 1, (3, 64, right)),
    ]
}

/// Gives a network the running statistics of pairs or of single images.
fn follow_images(network: &QualityNetwork) {
    for step in 0..PASSES {
        let both = pair(2 * step, [64, 64]);
        let images = &both[..network.cameras()];
        network.forward(images, Mode::Train { step }).unwrap();
    }
}

/// The left and the right camera's images may differ in size where the networks are separate.
#[test]
fn onnxruntime_says_the_same_of_pairs_by_every_fusion() {
    let folder = tempfile::tempdir().unwrap();
    let [path, io] = ["network.onnx", "io.safetensors"].map(|name| folder.path().join(name));
    let script = "
import sys, numpy, onnx, onnxruntime
from safetensors.numpy import load_file
model = onnx.load(sys.argv[1])
onnx.checker.check_model(model, full_check=True)
assert not any(node.op_type == 'BatchNormalization' for node in model.graph.node)
assert [(entry.key, entry.value) for entry in model.metadata_props] == [('mirror', 'true')]
io = load_file(sys.argv[2])
expected = io.pop('quality')
quality, = onnxruntime.InferenceSession(sys.argv[1]).run(None, io)
assert quality.shape == expected.shape == (3, 1)
assert numpy.ptp(expected) > 1e-2, expected
error = numpy.abs(quality - expected).max() / numpy.abs(expected).max()
print('onnxruntime: largest relative error', error, 'of', expected.ravel(), len(model.graph.node), 'nodes')
assert error < 1e-4
";
    let check = |network: &QualityNetwork, sides: [usize; 2]| {
        let [left, right] = pair(2 * PASSES, sides);
        let quality = network.forward(&[left.clone(), right.clone()], Mode::Eval);
        let tensors = [
            ("left", left),
            ("right", right),
            ("quality", quality.unwrap()),
        ];
        candle_core::safetensors::save(&HashMap::from(tensors), &io).unwrap();
        network
            .save_onnx(&path, WeightsMetadata::new(true, Targets::Quality))
            .unwrap();
        python(script, &[&path, &io]);
    };
    for kind in [FusionKind::Score, FusionKind::Late] {
        for (shared_weights, right) in [(false, 77), (true, 64)] {
            let fusion = Fusion {
                kind,
                shared_weights,
                ..Fusion::default()
            };
            let network =
                QualityNetwork::new(5, Options::default(), Some(fusion), Targets::Quality).unwrap();
            follow_images(&network);
            check(&network, [64, right]);
        }
    }
    let [left, right] = [1, 2].map(|seed| {
        let network =
            QualityNetwork::new(seed, Options::default(), None, Targets::Quality).unwrap();
        follow_images(&network);
        network
    });
    check(&QualityNetwork::averaged(&left, &right).unwrap(), [64, 77]);
}

#[test]
fn pytorch_and_the_network_load_each_others_weights() {
    let folder = tempfile::tempdir().unwrap();
    let (network, io) = exported(folder.path());
    let (path, back) = (
        folder.path().join("network.safetensors"),
        folder.path().join("network.pth"),
    );
    network.save(&path).unwrap();
    let script = "
import sys, torch, torchvision
from safetensors.torch import load_file
model = torchvision.models.efficientnet_b0(num_classes=1)
model.features[0][0] = torch.nn.Conv2d(1, 32, 3, 2, 1, bias=False)
model.load_state_dict(load_file(sys.argv[1]))
io = load_file(sys.argv[2])
with torch.no_grad():
    quality = model.eval()(io['images'])
error = ((quality - io['quality']).abs().max() / io['quality'].abs().max()).item()
print('torch: largest relative error', error, 'of', io['quality'].ravel())
assert io['quality'].max() - io['quality'].min() > 1e-2
assert error < 1e-4
torch.save(model.state_dict(), sys.argv[3])
";
    python(script, &[&path, &io, &back]);
    let other = EfficientNetB0::new(2, Options::default()).unwrap();
    assert_eq!(
        other.load(&back, FirstConvolution::Fresh).unwrap(),
        Loaded::default()
    );
    assert_eq!(values(&network), values(&other));
}

/// Modules with the authors' names and semantics, in evaluation.
const FUSED: &str = "
import sys, torch, torchvision
from safetensors.torch import load_file
weights, io = load_file(sys.argv[1]), load_file(sys.argv[2])
late = 'fc.3.weight' in weights
class Fused(torch.nn.Module):
    def __init__(self):
        super().__init__()
        def branch():
            model = torchvision.models.efficientnet_b0(num_classes=512 if late else 1)
            model.features[0][0] = torch.nn.Conv2d(1, 32, 3, 2, 1, bias=False)
            return model
        for name in ['module', 'cam_left_module', 'cam_right_module']:
            if name + '.classifier.1.bias' in weights:
                setattr(self, name, branch())
        if late:
            nn = torch.nn
            self.fc = nn.Sequential(nn.Linear(1024, 256), nn.SiLU(), nn.Dropout(0.3), nn.Linear(256, 1))
    def forward(self, left, right):
        shared = hasattr(self, 'module')
        left = (self.module if shared else self.cam_left_module)(left)
        right = (self.module if shared else self.cam_right_module)(right)
        if not late:
            return (left + right) / 2
        return self.fc(torch.nn.functional.silu(torch.cat([left, right], 1)))
model = Fused()
strange = model.load_state_dict(weights, strict=False)
assert not strange.unexpected_keys and all('num_batches' in key for key in strange.missing_keys), strange
with torch.no_grad():
    quality = model.eval()(io['left'], io['right'])
error = ((quality - io['quality']).abs().max() / io['quality'].abs().max()).item()
print('torch: largest relative error', error, 'of', io['quality'].ravel())
assert io['quality'].max() - io['quality'].min() > 1e-2
assert error < 1e-4
";

#[test]
fn pytorch_says_the_same_of_pairs_by_every_fusion() {
    let folder = tempfile::tempdir().unwrap();
    for kind in [FusionKind::Score, FusionKind::Late] {
        for shared_weights in [false, true] {
            let fusion = Fusion {
                kind,
                shared_weights,
                ..Fusion::default()
            };
            let network =
                QualityNetwork::new(5, Options::default(), Some(fusion), Targets::Quality).unwrap();
            follow_images(&network);
            let [left, right] = pair(2 * PASSES, [64, 64]);
            let quality = network
                .forward(&[left.clone(), right.clone()], Mode::Eval)
                .unwrap();
            let [weights, io] =
                ["weights", "io"].map(|n| folder.path().join(format!("{n}.safetensors")));
            network.save(&weights, WeightsMetadata::default()).unwrap();
            let tensors = [("left", left), ("right", right), ("quality", quality)];
            candle_core::safetensors::save(&HashMap::from(tensors), &io).unwrap();
            python(FUSED, &[&weights, &io]);
        }
    }
}

/// Every scalar of the log, by tag: its steps, its values in f32, and its seconds since the first one.
const READ_BACK: &str = "
import sys, json, collections, numpy
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
events = EventAccumulator(sys.argv[1])
events.Reload()
expected = collections.defaultdict(list)
for line in open(sys.argv[1] + '/log.jsonl'):
    row = json.loads(line)
    step, seconds = row.pop('step'), row.pop('seconds')
    for tag, value in row.items():
        expected[tag].append((step, numpy.float32(value), seconds))
assert len(expected) == 4, list(expected)
assert sorted(events.Tags()['scalars']) == sorted(expected), events.Tags()
for tag, rows in expected.items():
    found = [(event.step, numpy.float32(event.value), event.wall_time) for event in events.Scalars(tag)]
    assert [event[:2] for event in found] == [row[:2] for row in rows], (tag, found, rows)
    assert all(abs(event[2] - found[0][2] - row[2] + rows[0][2]) < 1e-3 for event, row in zip(found, rows)), tag
    print('tensorboard:', tag, len(found), 'values, the last one', found[-1][1], 'at step', found[-1][0])
";

#[test]
fn tensorboard_reads_all_scalars_of_a_training() {
    let data = toy::dataset(2, &[0, 90, 180]);
    let folder = tempfile::tempdir().unwrap();
    let of = |patient| {
        vec![Source {
            dataset: data.path().to_owned(),
            patients: Some(vec![patient]),
            shapes: None,
            every_pose: None,
            labels: None,
        }]
    };
    let config = TrainConfig {
        side: 32,
        steps: 6,
        batch_size: NonZeroUsize::new(4).unwrap(),
        log_every: NonZeroUsize::MIN,
        checkpoint_every: NonZeroUsize::new(2).unwrap(),
        training: of(0),
        evaluation: of(1),
        ..TrainConfig::quick()
    };
    train(&config, folder.path(), &AtomicBool::new(false), |_| {}).unwrap();
    python(READ_BACK, &[folder.path()]);
}
