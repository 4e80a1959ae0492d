#!/usr/bin/env python3
"""EfficientNet-B0 for one channel and one output in PyTorch on an NVIDIA GPU, to compare with the example `speed` of ppa-learn.

    benches/peers/networks_gpu.py train|infer BATCH SIZE STEPS
    cargo build --release -p ppa-learn --features cuda --example speed
    target/release/examples/speed train|infer 1 BATCH SIZE STEPS cuda

Prints images per second with and without TF32, in both memory layouts; each step ends when its loss or sum is on the CPU.
"""
import sys
import time

import torch
import torchvision


def images_per_second(what, batch, size, steps, tf32, layout):
    torch.backends.cudnn.allow_tf32 = tf32
    torch.backends.cuda.matmul.allow_tf32 = tf32
    torch.backends.cudnn.benchmark = True
    net = torchvision.models.efficientnet_b0(num_classes=1)
    net.features[0][0] = torch.nn.Conv2d(1, 32, kernel_size=3, stride=2, padding=1, bias=False)
    net = net.cuda().to(memory_format=layout)
    images = torch.randn(batch, 1, size, size, device="cuda").to(memory_format=layout)
    labels = 1.0 + 2.0 * torch.rand(batch, 1, device="cuda")
    adam = torch.optim.Adam(net.parameters(), lr=1e-3)

    def train():
        adam.zero_grad(set_to_none=True)
        loss = torch.nn.functional.mse_loss(net(images), labels)
        loss.backward()
        adam.step()
        return loss.item()

    def infer():
        with torch.inference_mode():
            return net(images).sum().item()

    step = {"train": train, "infer": infer}[what]
    net.train(what == "train")
    for _ in range(8):
        step()
    start = time.perf_counter()
    for _ in range(steps):
        step()
    return batch * steps / (time.perf_counter() - start)


def main():
    if len(sys.argv) != 5 or sys.argv[1] not in ("train", "infer"):
        sys.exit(__doc__)
    what, (batch, size, steps) = sys.argv[1], map(int, sys.argv[2:])
    for tf32 in (True, False):
        for layout in (torch.contiguous_format, torch.channels_last):
            found = images_per_second(what, batch, size, steps, tf32, layout)
            print(f"{what}, {batch} x {size} x {size}, TF32 {tf32}, {layout}: {found:.0f} images/s", flush=True)


if __name__ == "__main__":
    main()
