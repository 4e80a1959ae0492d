"""Trainings."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import threading
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ppa

from conftest import command

#: Small, quick steps.
QUICK: dict[str, Any] = {"preset": "quick", "side": 32, "batch_size": 4, "log_every": 1, "views": "pairs"}


@pytest.fixture(scope="module")
def persons(labelled: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of two persons with the same images."""
    data = tmp_path_factory.mktemp("persons") / "data"
    for patient in (0, 1):
        shutil.copytree(labelled / "patient_0", data / f"patient_{patient}")
    return data


def of(data: Path, patient: int) -> dict[str, Any]:
    return {"dataset": data, "patients": [patient]}


def test_weights_are_those_of_the_command(persons: Path, tmp_path: Path) -> None:
    (tmp_path / "train.toml").write_text(
        'preset = "quick"\nseed = 7\nside = 32\nsteps = 3\nbatch_size = 4\nlog_every = 1\nviews = "pairs"\n'
        f'[[training]]\ndataset = "{persons}"\npatients = [0]\n[[evaluation]]\ndataset = "{persons}"\npatients = [1]\n'
        '[augmentation]\nnoise_probability = 0.25\n'
    )
    command("train", tmp_path / "train.toml", "--out", tmp_path / "command")
    seen: list[tuple[float, float]] = []
    trained = ppa.train(
        of(persons, 0), tmp_path / "mine", evaluation=[of(persons, 1)], seed=7, steps=3, threads=1,
        augmentation={"noise_probability": 0.25}, progress=lambda *at: seen.append(at), **QUICK)
    for name in ["config.toml", "weights.safetensors"]:
        assert (tmp_path / "mine" / name).read_bytes() == (tmp_path / "command" / name).read_bytes(), name
    assert seen == [(1.0, 3.0), (2.0, 3.0), (3.0, 3.0)]
    mine, of_command = (
        [{key: row[key] for key in row if key != "seconds"} for row in ppa.training_log(tmp_path / run)]
        for run in ("mine", "command")
    )
    assert str(mine) == str(of_command)
    losses = [row["training/loss"] for row in mine if "training/loss" in row]
    assert len(losses) == 3 and all(map(math.isfinite, losses))
    assert trained == {"steps": 3, "last_loss": pytest.approx(losses[-1]), "start": None}
    assert "evaluation/mae" in mine[-1]
    again = ppa.train(of(persons, 0), tmp_path / "mine", evaluation=of(persons, 1), seed=7, steps=3,
                      augmentation={"noise_probability": 0.25}, **QUICK)
    assert again["last_loss"] is None
    other = ppa.train(of(persons, 0), tmp_path / "other", seed=8, steps=3, **QUICK)
    assert other["last_loss"] != trained["last_loss"]


def test_trainings_warn_of_findings_and_of_another_mirror(persons: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    shutil.copytree(persons, data)
    finding = {"patient": 0, "side": "r", "acknowledged": False, "code": "side-mismatch", "severity": "severe",
               "text": "the fibula lies medially"}
    (data / "findings.json").write_text(json.dumps([finding]))
    with pytest.warns(UserWarning, match=r"severe \[side-mismatch\] limb r of patient 0 of .*data: the fibula lies medially"):
        ppa.train(of(data, 0), tmp_path / "mirrored", mirror=True, steps=1, **QUICK)
    start = tmp_path / "mirrored" / "weights.safetensors"
    with pytest.warns(UserWarning, match="was trained with mirror = true, but this training shows left limbs without mirroring"):
        ppa.train(of(persons, 0), tmp_path / "run", start=start, mirror=False, steps=1, **QUICK)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ppa.train(of(persons, 0), tmp_path / "again", start=start, mirror=True, steps=1, **QUICK)
        with pytest.raises(UserWarning):
            ppa.train(of(data, 0), tmp_path / "refused", steps=1, **QUICK)
    assert not (tmp_path / "refused").exists()


def test_drawn_samples_follow_from_the_seed(persons: Path) -> None:
    samples = ppa.Dataset(persons, side=32)
    labels = [samples.drawn(place)[1] for place in range(60)]
    assert set(labels) == set(samples.labels)
    assert labels == [samples.drawn(place)[1] for place in range(60)]
    assert labels != [samples.drawn(place, seed=2)[1] for place in range(60)]
    assert labels != [samples.drawn(place, balanced=False)[1] for place in range(60)]
    image, _ = samples.drawn(0)
    assert image.shape == samples[0][0].shape
    noisy, _ = samples.drawn(0, augmentation={"noise_probability": 1.0, "noise_max_variance": 0.1})
    assert not np.array_equal(image, noisy)
    with pytest.raises(ppa.PpaError, match="noise_chance"):
        samples.drawn(0, augmentation={"noise_chance": 1.0})


@pytest.mark.usefixtures("listen")
def test_ctrl_c_ends_a_training_that_is_then_resumed(persons: Path, tmp_path: Path) -> None:
    begun, sent = threading.Event(), []

    def progress(done: float, total: float) -> None:
        if done >= 2 and not begun.is_set():
            begun.set()
            sent.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        ppa.train(of(persons, 0), tmp_path / "run", steps=1000, progress=progress, **QUICK)
    assert time.monotonic() - sent[0] < 1
    checkpoint = tmp_path / "run" / "checkpoint.safetensors"
    deadline = time.monotonic() + 60
    while not checkpoint.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert checkpoint.exists()
    assert not (tmp_path / "run" / "weights.safetensors").exists()
    with pytest.raises(ppa.PpaError, match="steps"):
        ppa.Network.load(tmp_path / "run", side="r")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"stepz": 3}, "ppa.train: unknown field `stepz`"),
        ({"steps": 0}, "steps is 0"),
        ({"side": 8}, "side is 8"),
        ({"preset": "fast"}, 'unknown preset "fast"'),
        ({"seed": -1}, "invalid value"),
        ({"training": []}, "training is empty"),
        ({"training": {"datasett": "x"}}, "datasett"),
        ({"training": 3}, "training holds neither a path"),
        ({"steps": object()}, "settings.steps is of type object"),
    ],
)
def test_trainings_that_make_no_sense_are_refused(
    persons: Path, tmp_path: Path, settings: dict[str, Any], says: str
) -> None:
    arguments = {"training": persons, "out": tmp_path / "run", "preset": "quick", **settings}
    with pytest.raises((ValueError, TypeError)) as refused:
        ppa.train(**arguments)
    assert says in str(refused.value)
    assert not (tmp_path / "run").exists()
    assert ppa.training_log(tmp_path / "run") == []


def test_a_person_in_training_and_evaluation_is_refused(persons: Path, tmp_path: Path) -> None:
    with pytest.raises(ppa.PpaError, match="must be in only one"):
        ppa.train(persons, tmp_path / "run", evaluation=of(persons, 1), **QUICK)
