"""Writes augmentation.json: what OpenCV and albumentations make of images that a formula gives.

    pip install albumentations==1.3.1 opencv-python-headless==4.8.1.78 'numpy<2'
    python make_augmentation_reference.py > ../tests/it/augmentation.json
"""

import json

import albumentations
import cv2
import numpy as np
from albumentations.augmentations.blur.functional import blur
from albumentations.augmentations.geometric.functional import hflip, rotate


def depth(width, height):
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    z = 600 + (x * 37 + y * 61 + (x * y) % 97 * 5) % 1200
    return np.where((x * 7 + y * 13) % 29 == 0, 0, z).astype(np.uint16)


def unit(width, height):
    return np.clip(depth(width, height).astype(np.float32), 0, 1500) / np.float32(1500)


def weighted(image):
    """Sum of pixels times weights that differ from neighbour to neighbour."""
    weights = np.arange(image.size, dtype=np.float64) * 7919 % 1009
    return float((image.astype(np.float64).ravel() * weights).sum())


def nearest(image, width, height):
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)


def rotated(image, angle):
    return rotate(image, angle, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE, None)


def gradient(image):
    return np.maximum(
        np.abs(cv2.Sobel(image, cv2.CV_64F, 1, 0, ksize=3)),
        np.abs(cv2.Sobel(image, cv2.CV_64F, 0, 1, ksize=3)),
    )


def rows(image):
    return [round(float(v), 9) for v in image.ravel()]


small, large = unit(13, 11), unit(403, 403)
sizes = [[300, 300, 403, 403], [517, 517, 403, 403], [403, 403, 336, 336], [180, 201, 403, 403], [371, 371, 336, 336],
         [61, 64, 40, 33], [7, 5, 16, 16], [336, 336, 336, 336], [13, 33, 354, 461]]
angles = [-15.0, -3.7, 0.0, 0.4, 7.3, 15.0]
print(json.dumps({
    "made_with": f"albumentations {albumentations.__version__}, OpenCV {cv2.__version__}, NumPy {np.__version__}",
    "nearest_exact": [{"from": s[:2], "to": s[2:], "weighted": weighted(nearest(depth(*s[:2]), *s[2:]))} for s in sizes],
    "flip": weighted(hflip(large)),
    "rotate": [{"degrees": a, "small": rows(rotated(small, a)), "large_weighted": weighted(rotated(large, a))} for a in angles],
    "blur": [{"side": k, "small": rows(blur(small, k)), "large_weighted": weighted(blur(large, k))} for k in (3, 5, 7)],
    "gradient": {"small": rows(gradient(small)), "large_weighted": weighted(gradient(large))},
    "quantile": {
        "small": float(np.quantile(gradient(small), 0.998)),
        "large": float(np.quantile(gradient(large), 0.998)),
        "large_above": int((gradient(large) > np.quantile(gradient(large), 0.998)).sum()),
    },
}))
