"""Labels computed from the bones."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import ppa

from conftest import Files, command

#: Small, quick radiographs; labels depend on the poses alone.
XRAY = {
    "half_length_mm": 20.0,
    "max_voxel_mm": 5.0,
    "detector": {"columns": 8, "rows": 8, "pixel_mm": 25.0},
    "engine": {"scatter_histories": 100, "scatter_pixel_mm": 200.0, "samples_per_side": 1},
}


@pytest.fixture(scope="module")
def ankle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a scan that is fine enough for labels, its bones and its case."""
    folder = tmp_path_factory.mktemp("ankle")
    volume = ppa.phantom(spacing_mm=1.2)
    volume.save(folder / "p01.nii")
    ppa.phantom_bones(volume).save(folder / "bones.nii")
    ppa.prepare(folder / "p01.nii", "r", bones=folder / "bones.nii").save(folder / "p01.toml")
    return folder


@pytest.fixture(scope="module")
def dataset(ankle: Path) -> Path:
    """A dataset of five poses, with its plan next to it."""
    plan = ppa.Plan(
        [(ankle / "p01.toml", 3)],
        rotation={"from_deg": 0, "to_deg": 36, "step_deg": 9},
        shapes={"variants": ["orig"]},
        xray=XRAY,
    )
    plan.save(ankle / "data.toml")
    ppa.generate(plan, ankle / "data")
    return ankle / "data"


def of_labels(dataset: Path) -> dict[str, bytes]:
    found = {str(path.relative_to(dataset)): path.read_bytes() for path in (dataset / "patient_3" / "labels").rglob("*.*")}
    return {name: read for name, read in found.items() if "roi" not in name}


def test_bones_of_phantoms_are_those_of_the_command(tmp_path: Path) -> None:
    command("ct", "phantom", "--name", "P04", "--spacing-mm", 3, "--out", tmp_path / "p04.nii", "--labels", tmp_path / "bones.nii")
    volume = ppa.Volume.read(tmp_path / "p04.nii")
    ppa.phantom_bones(volume, "P04").save(tmp_path / "mine.nii")
    assert (tmp_path / "mine.nii").read_bytes() == (tmp_path / "bones.nii").read_bytes()


def test_cases_with_bones_are_those_of_the_command(ankle: Path) -> None:
    other, mine = ankle / "other.toml", ankle / "mine.toml"
    command("prepare", ankle / "p01.nii", "--side", "r", "--bones", ankle / "bones.nii", "--no-picture", "--out", other)
    assert other.read_bytes() == (ankle / "p01.toml").read_bytes()
    case = ppa.Case.read(ankle / "p01.toml")
    assert case.bones is not None
    assert (case.bones["numbers"], case.bones.get("segmented")) == ({"tibia": 3, "fibula": 4, "talus": 1}, None)
    volume = ppa.Volume.read(ankle / "p01.nii")
    separated = ppa.prepare(volume, "r", segment_bones=ankle / "separated.nii.gz")
    separated.save(mine)
    command("prepare", ankle / "p01.nii", "--side", "r", "--segment-bones", ankle / "separated2.nii.gz", "--no-picture",
            "--replace", "--out", other)
    assert (ankle / "separated.nii.gz").read_bytes() == (ankle / "separated2.nii.gz").read_bytes()
    assert other.read_text().replace("separated2", "separated") == mine.read_text()
    with pytest.raises(FileExistsError, match="replace=True"):
        ppa.prepare(volume, "r", segment_bones=ankle / "separated.nii.gz")
    for settings, says in [
        ({"bones": ankle / "bones.nii", "segment_bones": ankle / "x.nii"}, "one or the other"),
        ({"bones": ankle / "bones.nii", "bone_numbers": (3, 4, 200)}, "talus"),
        ({"bones": ankle / "p01.nii"}, "whole numbers of bones"),
        ({"segment_bones": ankle / "p01.nii"}, "is the scan itself"),
        ({"segment_bones": ankle / "slices"}, "would be a DICOM CT"),
    ]:
        with pytest.raises(ValueError, match=says):
            ppa.prepare(volume, "r", **settings)
    with pytest.raises(FileNotFoundError):
        ppa.prepare(volume, "r", bones=ankle / "none.nii")


@pytest.mark.parametrize(
    ("options", "settings"),
    [
        ([], {}),
        (["--scale", "strict", "--name", "strict"], {"scale": "strict", "name": "strict"}),
        (["--thresholds", "t.toml", "--name", "wide"], {"thresholds": {"hidden_mm": [1, 3, 5, 7]}, "name": "wide"}),
    ],
)
def test_labels_are_those_of_the_command(
    ankle: Path, dataset: Path, tmp_path: Path, options: list[str], settings: dict[str, object]
) -> None:
    (ankle / "t.toml").write_text("hidden_mm = [1, 3, 5, 7]\n")
    shutil.copytree(dataset, tmp_path / "mine")
    shutil.copytree(dataset, tmp_path / "command")
    found = [str(ankle / option) if option.endswith(".toml") else option for option in options]
    printed = json.loads(command("label", "auto", tmp_path / "command", "--plan", ankle / "data.toml", "--json", *found))
    seen: list[tuple[float, float]] = []
    labelled = ppa.label(
        tmp_path / "mine", ankle / "data.toml", progress=lambda *at: seen.append(at), threads=1, **settings)
    assert labelled == printed
    assert seen == [(1.0, 1.0)]
    assert len(of_labels(tmp_path / "mine")) >= 3
    assert of_labels(tmp_path / "mine") == of_labels(tmp_path / "command")
    assert (tmp_path / "mine" / "labels.sha256").read_bytes() == (tmp_path / "command" / "labels.sha256").read_bytes()


def test_labels_of_poses_are_those_of_the_dataset(ankle: Path, dataset: Path) -> None:
    # The plan is next to the dataset.
    labelled = ppa.label(dataset)
    assert labelled["limbs"][0]["radiographs"] == 5
    rows = {row["angle_deg"]: row for row in ppa.Dataset(dataset, side=32).rows}
    scene = ppa.Scene(ankle / "data.toml")
    case = ppa.Case.read(ankle / "p01.toml")
    for angle in [0.0, 18.0, 36.0]:
        label = case.place(angle, scene=scene).label()
        assert (label["label"], label["std"]) == (rows[angle]["label"], rows[angle]["label_std"])
        assert [gutter["name"] for gutter in label["gutters"]] == ["medial", "superior", "lateral"]
        assert label["label"] == max(gutter["grade"] for gutter in label["gutters"])
    assert case.place(18, scene=scene).label()["label"] == 1.0
    front = case.place(0, scene=scene)
    assert front.label(thresholds={"hidden_mm": [40, 41, 42, 43]})["label"] < front.label()["label"]
    assert front.label(scale="strict")["label"] > 1.0


def test_labels_that_differ_are_not_replaced_unasked(dataset: Path, tmp_path: Path) -> None:
    shutil.copytree(dataset, tmp_path / "data")
    plan = dataset.with_suffix(".toml")
    ppa.label(tmp_path / "data", plan, name="x")
    before = of_labels(tmp_path / "data")
    with pytest.raises(ppa.PpaError, match="holds other computed labels"):
        ppa.label(tmp_path / "data", plan, name="x", scale="strict")
    assert of_labels(tmp_path / "data") == before
    ppa.label(tmp_path / "data", plan, name="x", scale="strict", replace=True)
    assert of_labels(tmp_path / "data") != before


def test_what_cannot_be_labelled_is_refused(files: Files, case: ppa.Case, dataset: Path) -> None:
    with pytest.raises(ppa.PpaError, match="does not specify bones"):
        case.place(0).label()
    for settings, says in [
        ({"scale": "kind"}, "unknown scale \"kind\""),
        ({"thresholds": {"hidden_mm": [3, 2, 1, 0]}}, "increasing"),
        ({"thresholds": {"at_least": [1, 1, 1, 1]}}, "thresholds"),
        ({"name": "computed"}, "choose a name other than"),
        ({"plan": files.plan}, "patient 0"),
    ]:
        with pytest.raises(ppa.PpaError, match=says):
            ppa.label(dataset, **settings)
    with pytest.raises(FileNotFoundError):
        ppa.label(dataset / "none", files.plan)
