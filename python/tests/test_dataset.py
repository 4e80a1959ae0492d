"""Datasets for PyTorch, and networks."""

from __future__ import annotations

import json
import math
import multiprocessing
import pickle
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import ppa

from conftest import command, program


def test_samples_are_images_and_labels(labelled: Path) -> None:
    samples = ppa.Dataset(labelled, side=64)
    assert len(samples) == 3 * 2
    image, label = samples[0]
    assert image.shape == (2, 64, 64) and image.dtype == np.float32
    assert -0.5 <= image.min() < image.max() <= 0.5
    assert label == samples.labels[0] == samples.rows[0]["label"]
    np.testing.assert_array_equal(samples[-1][0], samples[len(samples) - 1][0])
    assert sorted({row["angle_deg"] for row in samples.rows}) == [0.0, 10.0, 20.0]
    assert len(list(samples)) == len(samples)
    with pytest.raises(IndexError):
        samples[len(samples)]


def test_samples_can_be_selected(labelled: Path) -> None:
    assert len(ppa.Dataset(labelled, views="unified")) == 3 * 2 * 2
    assert len(ppa.Dataset(labelled, views="left", shapes=["orig"], every_pose=2)) == 2
    assert ppa.Dataset(labelled, views="left", side=32)[0][0].shape == (1, 32, 32)
    assert ppa.Dataset(labelled, transform=lambda image: image.sum())[0][0].shape == ()
    for refused in [{"patients": [7]}, {"shapes": ["round"]}, {"views": "above"}, {"side": 0}, {"every_pose": 0}, {"labels": "x"}]:
        with pytest.raises((ValueError, OSError)):
            ppa.Dataset(labelled, **refused)


def test_images_without_labels_are_taken_on_request(labelled: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    shutil.copytree(labelled, data)
    labels = data / "patient_0" / "labels" / "r" / "labels.json"
    rows = json.loads(labels.read_text())
    rows.pop(next(iter(rows)))
    labels.write_text(json.dumps(rows))
    with pytest.raises(ppa.PpaError, match="has no label in labels.json"):
        ppa.Dataset(data)
    some = ppa.Dataset(data, side=32, unlabelled=True)
    assert np.isnan(some.labels).sum() == 2
    labels.unlink()
    none = pickle.loads(pickle.dumps(ppa.Dataset(data, side=32, unlabelled=True)))
    every = ppa.Dataset(labelled, side=32)
    assert len(none) == len(every) and np.isnan(none.labels).all()
    for (image, label), (same, _), row in zip(none, every, none.rows):
        np.testing.assert_array_equal(image, same)
        assert math.isnan(label) and math.isnan(row["label"])
    with pytest.raises(ppa.PpaError, match="NaN"):
        none.drawn(0)


def first_pixel(arguments: tuple[ppa.Dataset, int]) -> float:
    samples, index = arguments
    return float(samples[index][0].sum())


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_read_the_same_samples(labelled: Path, method: str) -> None:
    samples = ppa.Dataset(labelled, side=32)
    again = pickle.loads(pickle.dumps(samples))
    np.testing.assert_array_equal(samples[1][0], again[1][0])
    with multiprocessing.get_context(method).Pool(2) as pool:
        sums = pool.map_async(first_pixel, [(samples, i) for i in range(4)]).get(timeout=120)
    assert sums == [first_pixel((samples, i)) for i in range(4)]


def test_a_folder_without_a_training_is_refused(labelled: Path) -> None:
    with pytest.raises((ValueError, OSError)) as refused:
        ppa.Network.load(labelled)
    assert str(labelled) in str(refused.value)


@pytest.fixture(scope="module")
def training(labelled: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a training with few, small steps on two persons with the same images."""
    folder = tmp_path_factory.mktemp("training")
    for patient in (0, 1):
        shutil.copytree(labelled / "patient_0", folder / "data" / f"patient_{patient}")
    (folder / "train.toml").write_text(
        'preset = "quick"\nside = 32\nsteps = 4\nbatch_size = 4\nlog_every = 1\nviews = "pairs"\n'
        '[[training]]\ndataset = "data"\npatients = [0]\n[[evaluation]]\ndataset = "data"\npatients = [1]\n'
    )
    command("train", folder / "train.toml", "--out", folder / "run")
    return folder


def test_networks_say_what_the_command_line_says(training: Path) -> None:
    png = pytest.importorskip("PIL.Image")
    frames = [training / f"data/patient_0/depth/r/orig/depth_cam_{view}_10.0.png" for view in ("left", "right")]
    regions = [(200, 150, 220), (210, 160, 200)]
    options = [",".join(map(str, region)) for region in regions]
    printed = subprocess.run(
        [program(), "predict", str(training / "run"), "--stdin", "--side", "r",
         "--roi-left", options[0], "--roi-right", options[1]],
        input="\t".join(map(str, frames)) + "\n", capture_output=True, text=True, check=True,
    ).stdout
    network = ppa.Network.load(training / "run", side="r")
    left, right = (np.array(png.open(frame)).astype(np.uint16) for frame in frames)
    answer = network.predict(left, right, roi_left=regions[0], roi_right=regions[1])
    assert answer["quality"] == json.loads(printed)["quality"]
    # Arrays that are not contiguous give the same result.
    wide = np.repeat(left, 2, axis=1)[:, ::2]
    assert network.predict(wide, right, roi_left=regions[0], roi_right=regions[1]) == answer
    square = network.predict(left[150:370, 200:420], right[160:360, 210:410])
    assert square["quality"] == pytest.approx(answer["quality"])
    for bad, says in [
        ((left.astype(np.int32), right), "depth_left is an array of int32"),
        ((left, right), "give roi_left"),
        ((left[:0], right), "depth_left has no pixels"),
    ]:
        with pytest.raises(ValueError, match=says):
            network.predict(*bad)
    with pytest.raises(ValueError, match="outside"):
        network.predict(left, right, roi_left=(900, 0, 10), roi_right=regions[1])
    with pytest.raises(ValueError, match='side="l" or "r"'):
        ppa.Network.load(training / "run")


def test_networks_look_at_the_joint_of_depth_images(training: Path, case: ppa.Case, scene: ppa.Scene) -> None:
    network = ppa.Network.load(training / "run", side="r")
    pose = case.place(10, scene=scene)
    left, right = pose.depth("left"), pose.depth("right")
    assert left.roi is not None and right.roi is not None
    given = network.predict(left.to_uint16(), right.to_uint16(), roi_left=left.roi, roi_right=right.roi)
    assert network.predict(left, right) == given
    with pytest.raises(ValueError, match="outside"):
        network.predict(left, right, roi_left=(900, 0, 10))
    half = math.sqrt(0.5)
    turned = np.array([[half, 0, half, 0], [0, 1, 0, 0], [-half, 0, half, 0], [0, 0, 0, 1]])
    beside = pose.depth(ppa.Camera(pose.frames["room_from_left"] @ turned, left.lens))
    assert beside.roi is None
    with pytest.raises(ValueError, match="give roi_right"):
        network.predict(left, beside)
    with pytest.raises(ValueError, match=r"found \(-1, 0, 10\), expected whole numbers from 0 to 4294967295"):
        network.predict(left, right, roi_left=(-1, 0, 10))
