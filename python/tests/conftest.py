"""Fixtures of the tests: a small phantom, its case, and the command-line program."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import ppa

#: X-ray settings for quick tests.
QUICK_XRAY = {
    "detector": {"columns": 48, "rows": 40, "pixel_mm": 5.0},
    "engine": {"scatter_histories": 4000, "dose_histories": 1e9},
    "max_voxel_mm": 4.0,
}


@dataclass
class Files:
    """A scan, its case and a plan, as files."""

    folder: Path
    scan: Path
    case: Path
    plan: Path


@pytest.fixture(scope="session")
def volume() -> ppa.Volume:
    return ppa.phantom("P01", spacing_mm=2.0)


@pytest.fixture(scope="session")
def case(volume: ppa.Volume) -> ppa.Case:
    return ppa.prepare(volume, "r")


@pytest.fixture(scope="session")
def scene() -> ppa.Scene:
    return ppa.Scene(ppa.Plan(xray=QUICK_XRAY))


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory, volume: ppa.Volume) -> Files:
    folder = tmp_path_factory.mktemp("files")
    scan, case, plan = folder / "p01.nii.gz", folder / "p01.case.toml", folder / "plan.toml"
    volume.save(scan)
    ppa.prepare(ppa.Volume.read(scan), "r").save(case)
    ppa.Plan(
        [(case, 0)],
        seed=5,
        rotation={"from_deg": 0, "to_deg": 20, "step_deg": 10},
        shapes={"variants": ["orig", "bumps_a"]},
        positioning={"tilt_deg": 2.0, "beam_shift_mm": [5.0, -10.0]},
        depth={"sensor": {"random": {"floor_mm": 1.0, "at_unit_signal_mm": 2.0}}},
        xray=QUICK_XRAY,
    ).save(plan)
    return Files(folder, scan, case, plan)


@pytest.fixture(scope="session")
def labelled(files: Files, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with labels in the format of readers' labels."""
    folder = tmp_path_factory.mktemp("labelled") / "data"
    ppa.generate(files.plan, folder)
    radiographs = sorted((folder / "patient_0" / "xray" / "r").glob("*.png"))
    steps = {path.name: int(path.stem.rpartition("_")[2]) for path in radiographs}
    rows = {name: {"label": 1.0 + step / 20, "std": 0.0, "step": step} for name, step in steps.items()}
    labels = folder / "patient_0" / "labels" / "r" / "labels.json"
    labels.parent.mkdir(parents=True, exist_ok=True)
    labels.write_text(json.dumps(rows))
    return folder


@pytest.fixture
def listen() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, even if the shell that started the tests ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def program() -> str:
    """The program to compare with: the one that cargo built, or that of the package."""
    return os.environ.get("PPA_PROGRAM") or str(Path(sys.executable).parent / "ppa")


def command(*arguments: object) -> str:
    """Run a command line and return its output."""
    ran = subprocess.run(
        [program(), *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout
