"""Paired Time-of-Flight depth images and radiographs of posed limbs from CT scans.

Lengths are in mm, angles in degrees, Hounsfield units in int16 or float32; transforms are named ``target_from_source``.

>>> import ppa
>>> case = ppa.prepare(ppa.phantom("P07"), side="r")
>>> pose = case.place(angle=18)
>>> depth = pose.depth("left", sensor="default")
>>> radiograph = pose.radiograph(technique="ankle")
"""

from ._ppa import (
    Camera,
    Case,
    Dataset,
    DepthImage,
    InternalError,
    Material,
    Network,
    Plan,
    Pose,
    PpaError,
    Radiograph,
    Scene,
    Spectrum,
    Transport,
    Volume,
    __version__,
    evaluate,
    generate,
    label,
    permutation_test,
    phantom,
    phantom_bones,
    phantom_truth,
    prepare,
    train,
    training_log,
)

__all__ = [
    "Camera",
    "Case",
    "Dataset",
    "DepthImage",
    "InternalError",
    "Material",
    "Network",
    "Plan",
    "Pose",
    "PpaError",
    "Radiograph",
    "Scene",
    "Spectrum",
    "Transport",
    "Volume",
    "__version__",
    "evaluate",
    "generate",
    "label",
    "permutation_test",
    "phantom",
    "phantom_bones",
    "phantom_truth",
    "prepare",
    "train",
    "training_log",
]
