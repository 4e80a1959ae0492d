#!/usr/bin/env python3
"""EfficientNet-B0 for one channel and one output in PyTorch and onnxruntime, in turn with the example `speed` of ppa-learn.

    cargo build --release -p ppa-learn --example speed
    pip install torch torchvision onnx onnxruntime numpy
    benches/peers/networks.py train|train_channels_last|infer_onnxruntime|infer_eager [ROUNDS]

With MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=20000000000 MALLOC_TOP_PAD_=1000000000 in the environment, glibc keeps freed memory
for both programs.
"""
import processor_time  # before the libraries

import io
import json
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
SPEED = ROOT / "target/release/examples/speed"
SIDE, BATCH, TRAINING_STEPS, INFERENCES = 336, 16, 3, 20


def network():
    import torch
    import torchvision

    torch.set_num_threads(1)
    torch.manual_seed(1)
    net = torchvision.models.efficientnet_b0(num_classes=1, dropout=0.5, stochastic_depth_prob=0.2)
    net.features[0][0] = torch.nn.Conv2d(1, 32, kernel_size=3, stride=2, padding=1, bias=False)
    return net


def train(layout="contiguous_format"):
    """A step of training on a batch, and its number of images."""
    import torch

    layout = getattr(torch, layout)
    net = network().train().to(memory_format=layout)
    images = torch.randn(BATCH, 1, SIDE, SIDE).to(memory_format=layout)
    labels = 1.0 + 2.0 * torch.rand(BATCH, 1)
    adam = torch.optim.Adam(net.parameters(), lr=1e-3)

    def step():
        adam.zero_grad(set_to_none=True)
        torch.nn.functional.mse_loss(net(images), labels).backward()
        adam.step()

    return step, BATCH


def infer_eager():
    import torch

    net, image = network().eval(), torch.randn(1, 1, SIDE, SIDE)

    def forward():
        with torch.inference_mode():
            net(image)

    return forward, 1


def infer_onnxruntime():
    import onnxruntime
    import torch

    net, image = network().eval(), torch.randn(1, 1, SIDE, SIDE)
    file = io.BytesIO()
    torch.onnx.export(net, (image,), file, input_names=["image"], dynamo=False)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        file.getvalue(), options, providers=["CPUExecutionProvider"]
    )
    given = {"image": image.numpy()}
    return lambda: session.run(None, given), 1


# What is measured, what `speed` is asked for, and the number of steps.
CASES = {
    "train": (train, "train", TRAINING_STEPS),
    "train_channels_last": (lambda: train("channels_last"), "train", TRAINING_STEPS),
    "infer_onnxruntime": (infer_onnxruntime, "infer", INFERENCES),
    "infer_eager": (infer_eager, "infer", INFERENCES),
}


def measure(case):
    """Images per processor second of the peer, after one step to warm up."""
    prepare, _, steps = CASES[case]
    step, images = prepare()
    step()
    start = processor_time.used()
    for _ in range(steps):
        step()
    print(json.dumps({"images_per_cpu_s": images * steps / (processor_time.used() - start)}))


def main():
    if len(sys.argv) < 2 or sys.argv[1] not in CASES:
        sys.exit(__doc__)
    case, rounds = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "3"
    if rounds == "once":
        return measure(case)
    _, what, steps = CASES[case]
    batch = BATCH if what == "train" else 1
    commands = {
        "peer": [sys.executable, __file__, case, "once"],
        "ppa-learn": [str(SPEED), what, "1", str(batch), str(SIDE), str(steps)],
    }
    best = dict.fromkeys(commands, 0.0)
    for _ in range(int(rounds)):
        for name, command in commands.items():
            _, output = processor_time.of_program(command)
            found = json.loads(output.splitlines()[-1])["images_per_cpu_s"]
            best[name] = max(best[name], found)
    ratio = round(best["ppa-learn"] / best["peer"], 2)
    images = {name: round(found, 1) for name, found in best.items()}
    print(json.dumps({"what": case, "images_per_processor_s": images, "ratio": ratio}))


if __name__ == "__main__":
    main()
