"""The same settings give the same bytes as on the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import ppa

from conftest import Files, command


def test_phantoms(tmp_path: Path) -> None:
    command("ct", "phantom", "--name", "P03", "--side", "l", "--spacing-mm", 3, "--noise-hu", 10, "--blur-mm", 2,
            "--table", "--out", tmp_path / "a.nii.gz")
    ppa.phantom("P03", "l", spacing_mm=3, noise_hu=10, blur_mm=2, table=True).save(tmp_path / "b.nii.gz")
    assert (tmp_path / "a.nii.gz").read_bytes() == (tmp_path / "b.nii.gz").read_bytes()


def test_cases(files: Files) -> None:
    other = files.folder / "other.case.toml"
    joint = ppa.Case.read(files.case).joint + (1.0, 0.0, 0.0)
    of_joint = ",".join(map(repr, joint.tolist()))
    command("prepare", files.scan, "--side", "r", "--joint", of_joint, "--no-picture", "--out", other)
    case = ppa.prepare(files.scan, "r", joint=joint)
    assert case.joint.tolist() == joint.tolist()
    case.save(files.folder / "mine.case.toml")
    assert other.read_bytes() == (files.folder / "mine.case.toml").read_bytes()
    changed = ppa.prepare(ppa.Volume.read(files.scan), "r")
    changed.joint = joint
    changed.save(files.folder / "mine.case.toml")
    assert other.read_bytes() == (files.folder / "mine.case.toml").read_bytes()


def test_cases_with_other_bodies(files: Files) -> None:
    whole = ppa.Volume.read(files.scan)
    voxels = whole.voxels.copy()
    # A block in the air next to the limb.
    voxels[:16, :16, 20:60] = 100
    assert (whole.voxels[:20, :20, 16:64] < -900).all()
    scan = files.folder / "block.nii.gz"
    ppa.Volume(voxels, whole.affine).save(scan)
    points = [(whole.affine @ (*index, 1))[:3] for index in [(8, 8, 40), (8, 8, 30)]]
    options = [f"--keep={','.join(map(repr, point.tolist()))}" for point in points]
    command("prepare", scan, "--side", "r", *options, "--no-picture", "--out", files.folder / "kept.case.toml")
    kept = ppa.prepare(ppa.Volume.read(scan), "r", keep=points)
    kept.save(files.folder / "mine.case.toml")
    assert (files.folder / "kept.case.toml").read_bytes() == (files.folder / "mine.case.toml").read_bytes()
    limb = ppa.prepare(scan, "r", keep=[])
    assert len(kept.vertices) > len(limb.vertices)
    kept.joint = kept.joint
    assert len(kept.vertices) > len(limb.vertices), "another choice"
    ball = (*limb.vertices[len(limb.vertices) // 2].tolist(), 12.0)
    option = f"--remove={','.join(map(repr, ball))}"
    command("prepare", scan, "--side", "r", option, "--no-picture", "--out", files.folder / "cut.case.toml")
    cut = ppa.prepare(ppa.Volume.read(scan), "r", remove=[ball])
    cut.save(files.folder / "my_cut.case.toml")
    assert (files.folder / "cut.case.toml").read_bytes() == (files.folder / "my_cut.case.toml").read_bytes()
    for bad, says in [
        ([(0, 0, 9000)], "(0, 0, 9000) mm of a body to keep is not in solid tissue"),
        ((0.0, 0.0, 0.0), "keep has the shape (3,), expected (n, 3)"),
        ([(0.0, 0.0, float("nan"))], "keep contains NaN"),
    ]:
        with pytest.raises(ValueError) as refused:
            ppa.prepare(scan, "r", keep=bad)
        assert says in str(refused.value)


def test_depth_images(files: Files, tmp_path: Path) -> None:
    command("depth", "render", files.case, "--angle", 18, "--out", tmp_path / "d.png", "--exr", tmp_path / "d.exr")
    pose = ppa.Case.read(files.case).place(18)
    for view in ["left", "right"]:
        image = pose.depth(view)
        for kind in ["png", "exr"]:
            image.save(tmp_path / f"mine.{kind}")
            assert (tmp_path / f"mine.{kind}").read_bytes() == (tmp_path / f"d_{view}.{kind}").read_bytes()
    command("depth", "render", files.case, "--angle", 18, "--view", "right", "--sensor", "default", "--seed", 3,
            "--out", tmp_path / "s.png")
    pose.depth("right", sensor="default", seed=3).save(tmp_path / "mine.png")
    assert (tmp_path / "mine.png").read_bytes() == (tmp_path / "s.png").read_bytes()


def test_poses(files: Files, tmp_path: Path) -> None:
    printed = json.loads(command("scene", "place", files.case, "--angle", 30, "--frames", tmp_path / "f.json", "--json"))
    pose = ppa.Case.read(files.case).place(30)
    assert pose.room_from_patient.tolist() == printed["room_from_patient"]
    assert {key: pose.contact[key] for key in pose.contact} == {key: printed[key] for key in pose.contact}
    motions = json.loads((tmp_path / "f.json").read_text())["motions"]
    assert {name: motion.tolist() for name, motion in pose.frames.items()} == motions


def test_radiographs(files: Files, tmp_path: Path) -> None:
    pose = ppa.Case.read(files.case).place(18, scene=ppa.Scene(files.plan))
    for options, settings in [
        (["--seed", 4], {"seed": 4}),
        (["--mas", 2, "--kvp", 70], {"mas": 2, "tube": {"kvp": 70}}),
        (["--aec", 250], {"exposure_index": 250}),
        (["--engine", "analog", "--histories", 40000, "--seed", 4],
         {"engine": "analog", "histories": 40000, "seed": 4}),
    ]:
        command("xray", "simulate", files.case, "--plan", files.plan, "--angle", 18, *options, "--replace",
                "--out", tmp_path / "x.png", "--exr", tmp_path / "x.exr")
        for threads in [None, 1]:
            radiograph = pose.radiograph(threads=threads, **settings)
            for kind in ["png", "exr"]:
                radiograph.save(tmp_path / f"mine.{kind}")
                same = (tmp_path / f"mine.{kind}").read_bytes() == (tmp_path / f"x.{kind}").read_bytes()
                assert same, (options, kind, threads)


def test_doses(files: Files, tmp_path: Path) -> None:
    printed = json.loads(command(
        "xray", "simulate", files.case, "--plan", files.plan, "--engine", "analog", "--histories", 40000,
        "--dose-map", tmp_path / "dose.nii", "--out", tmp_path / "x.png", "--json"))
    pose = ppa.Case.read(files.case).place(0, scene=ppa.Scene(files.plan))
    radiograph = pose.radiograph(engine="analog", histories=40000, dose="map")
    dose = radiograph.dose
    assert dose is not None
    assert list(dose["materials"]) == printed["materials"]
    ev = [material["ev_per_history"]["value"] for material in dose["materials"].values()]
    assert ev == printed["material_dose_ev_per_history"]
    assert dose["detector_air_kerma_gy_per_history"]["se"] == printed["detector_air_kerma_gy_per_history_se"]
    radiograph.dose_map().save(tmp_path / "mine.nii")
    assert (tmp_path / "mine.nii").read_bytes() == (tmp_path / "dose.nii").read_bytes()
    sums = printed["projections"][0]
    assert {key: radiograph.sums[key] for key in radiograph.sums} == {key: sums[key] for key in radiograph.sums}


def images(folder: Path) -> dict[str, bytes]:
    found = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.suffix in (".png", ".exr")}
    assert len(found) == 3 * (2 * 2 + 2)
    return found


def test_datasets(files: Files, tmp_path: Path) -> None:
    command("generate", files.plan, "--out", tmp_path / "command")
    rois = json.loads((tmp_path / "command/patient_0/labels/r/roi_depth.json").read_text())
    pose = ppa.Case.read(files.case).place(10, scene=ppa.Scene(files.plan))
    for view in ["left", "right"]:
        row = rois[f"depth_cam_{view}_10.0.png"]
        assert pose.depth(view).roi == (row["x_start"], row["y_start"], row["size"])
    seen: list[tuple[float, float]] = []
    summary = ppa.generate(ppa.Plan.read(files.plan), tmp_path / "mine", progress=lambda *at: seen.append(at), threads=1)
    assert summary["made"] == 3
    assert seen[-1] == (3.0, 3.0)
    assert images(tmp_path / "command") == images(tmp_path / "mine")
    again = ppa.generate(files.plan, tmp_path / "mine")
    assert again["made"] == 0
    with pytest.raises(ppa.PpaError) as refused:
        ppa.generate(files.plan, tmp_path / "mine", seed=6)
    assert "seed" in str(refused.value)
    assert "replace=True" in str(refused.value)


def test_the_package_runs_the_program(tmp_path: Path) -> None:
    script = Path(sys.executable).parent / "ppa"
    if not script.exists():
        pytest.skip("the package is not installed")
    ran = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == f"ppa {ppa.__version__}"
    failed = subprocess.run([script, "ct", "info", tmp_path / "none", "--json"], capture_output=True, text=True)
    assert failed.returncode == 1
    assert "none" in json.loads(failed.stderr)["error"] + "".join(json.loads(failed.stderr)["causes"])
    assert subprocess.run([script, "ctt"], capture_output=True).returncode == 2
