"""Cases, poses and their images."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ppa


def test_the_skin_is_closed_but_for_cuts_and_oriented(case: ppa.Case) -> None:
    vertices, triangles, normals = case.vertices, case.triangles, case.normals
    assert vertices.dtype == normals.dtype == np.float32
    assert triangles.dtype == np.uint32
    assert vertices.shape == normals.shape
    assert triangles.max() < len(vertices)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4)
    a, b, c = (vertices[triangles[:, corner]].astype(float) for corner in range(3))
    across = np.cross(b - a, c - a)
    assert np.mean(np.sum(across * normals[triangles[:, 0]], axis=1) > 0) > 0.99


def test_landmarks_are_near_those_of_the_phantom(case: ppa.Case) -> None:
    truth = ppa.phantom_truth("P01")
    assert np.linalg.norm(case.joint - truth["joint_centre"]) < 8
    axis = case.axis
    direction = (axis[1] - axis[0]) / 100
    assert np.linalg.norm(direction) == pytest.approx(1)
    assert direction @ truth["axis_direction"] > np.cos(np.radians(4))
    assert case.side == "r"


def test_landmarks_can_be_set(volume: ppa.Volume) -> None:
    case = ppa.prepare(volume, "r")
    joint, axis, plane = case.joint, case.axis, case.plane
    case.joint = joint + [0, 0, 2]
    assert case.joint.tolist() == (joint + [0, 0, 2]).tolist()
    case.plane = plane + [0, 1, 0]
    np.testing.assert_array_equal(case.plane, plane + [0, 1, 0])
    case.axis = axis + [1, 0, 0]
    moved = case.axis
    along = (axis[1] - axis[0]) / 100
    np.testing.assert_allclose(np.cross(moved[0] - axis[0] - [1, 0, 0], along), 0, atol=1e-6)
    case.anterior = [0, -1, 0]
    # Only the component perpendicular to the axis counts.
    assert case.anterior @ [0, -1, 0] > 0.99
    assert case.anterior @ (case.axis[1] - case.axis[0]) == pytest.approx(0, abs=1e-9)
    for name, bad in [("joint", [0, 0]), ("axis", [[0, 0, np.nan]] * 2), ("plane", "x"), ("anterior", None)]:
        with pytest.raises((ValueError, TypeError), match=name):
            setattr(case, name, bad)


def test_a_pose_brings_the_skin_onto_the_table(case: ppa.Case, scene: ppa.Scene) -> None:
    pose = case.place(18, scene=scene)
    normal, offset = scene.table[:3], scene.table[3]
    assert np.min(pose.vertices @ normal) - offset == pytest.approx(0, abs=0.01)
    homogeneous = np.column_stack([case.vertices, np.ones(len(case.vertices))])
    np.testing.assert_allclose((homogeneous @ pose.room_from_ct.T)[:, :3], pose.vertices, atol=1e-3)


def test_a_camera_of_ones_own_sees_what_that_of_the_scene_sees(case: ppa.Case, scene: ppa.Scene) -> None:
    pose = case.place(10, scene=scene)
    left = pose.depth("left")
    own = pose.depth(ppa.Camera(pose.frames["room_from_left"], left.lens))
    assert left.z_mm.shape == (left.lens["height"], left.lens["width"])
    close = np.isclose(left.z_mm, own.z_mm, atol=0.01)
    assert close.mean() > 0.999
    assert np.abs(left.to_uint16() - left.z_mm).max() <= 0.5
    points = left.points()
    assert len(points) == np.count_nonzero(left.z_mm)
    assert np.asarray(left).dtype == np.float32
    assert np.asarray(left, dtype=np.float64).dtype == np.float64


def test_a_radiograph_is_the_sum_of_its_layers(case: ppa.Case, scene: ppa.Scene) -> None:
    radiograph = case.place(18, scene=scene).radiograph(histories=1e9)
    assert list(radiograph.layers) == ["primary", "compton", "rayleigh", "multiple"]
    assert list(radiograph.standard_errors) == list(radiograph.layers)
    total = sum(layer.astype(float) for layer in radiograph.layers.values())
    np.testing.assert_allclose(radiograph.total, total, rtol=1e-5)
    assert radiograph.total.shape == (40, 48)
    assert np.all(radiograph.total_error > 0)
    assert radiograph.total.min() < 0.3 * radiograph.open_field.max()
    assert radiograph.histories == 1e9
    assert radiograph.mas == pytest.approx(1e9 / radiograph.histories_per_mas)
    assert radiograph.picture().dtype == np.uint16
    assert radiograph.picture("ankle_ap", fitted=True).max() > 0
    for layer in radiograph.layers.values():
        assert not layer.flags.owndata and not layer.flags.writeable


def test_the_analog_engine_stops_at_an_error(case: ppa.Case, scene: ppa.Scene) -> None:
    seen: list[float] = []
    radiograph = case.place(0, scene=scene).radiograph(
        engine="analog", target_error=0.2, dose=True, progress=lambda done, total: seen.append(done / total))
    reached = radiograph.total > 0
    error = np.full(reached.shape, np.inf)
    error[reached] = radiograph.total_error[reached] / radiograph.total[reached]
    assert np.median(error) <= 0.2
    assert radiograph.histories < 1e9
    assert radiograph.dose is not None and radiograph.dose["phantom"]["mass_g"] > 500
    assert seen and all(0 <= share <= 1 for share in seen)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"engine": "exact"}, 'engine is "exact", expected "fast" or "analog"'),
        ({"target_error": 0.1}, 'target_error needs engine="analog"'),
        ({"dose": True}, 'dose needs engine="analog"'),
        ({"engine": "analog", "dose": "all"}, "dose is 'all'"),
        ({"engine": "analog", "mas": 4}, 'need engine="fast"'),
        ({"engine": "analog", "target_error": 2}, "target_error is 2"),
        ({"engine": "analog", "seconds": float("nan")}, "seconds is NaN"),
        ({"engine": "analog", "histories": 0}, "histories is 0"),
        ({"mas": 4, "histories": 1e9}, "mutually exclusive"),
        ({"mas": -1}, "tube load in mAs"),
        ({"histories": -5}, "histories"),
        ({"technique": "chest"}, 'technique is "chest"'),
        ({"tube": {"kV": 60}}, 'tube has the key "kV"'),
        ({"tube": {"kvp": 1e9}}, "1000000000"),
        ({"xray": {"detector": {"columns": 5}}}, "xray"),
        ({"xray": {"detector": {"columns": 0, "rows": 1, "pixel_mm": 1.0}}}, "0 x 1"),
        ({"xray": {"max_voxel_mm": 3.0}}, "limb's voxels"),
        ({"xray": {1: 2}}, "a key of xray is not text"),
        ({"xray": {"kvp": object()}}, "xray.kvp is of type object"),
        ({"threads": 0}, "threads is 0"),
        ({"threads": 5000}, "threads is 5000"),
        ({"threads": -1}, "threads is -1, expected 1 to 1024"),
        ({"seed": -1}, "found -1, expected whole numbers from 0 to 18446744073709551615"),
    ],
)
def test_exposures_that_make_no_sense_are_refused(
    case: ppa.Case, scene: ppa.Scene, settings: Any, says: str
) -> None:
    with pytest.raises((ValueError, TypeError)) as refused:
        case.place(0, scene=scene).radiograph(**settings)
    assert says in str(refused.value)


def test_images_that_make_no_sense_are_refused(case: ppa.Case, scene: ppa.Scene, tmp_path: Any) -> None:
    pose = case.place(0, scene=scene)
    for call in [
        lambda: pose.depth("middle"),
        lambda: pose.depth(sensor={"rndom": 1}),
        lambda: pose.depth(sensor=3),
        lambda: ppa.Camera(np.diag([1.0, 1, 2, 1])),
        lambda: ppa.Camera(np.eye(4), {"model": "pinhole"}),
        lambda: pose.depth().save(tmp_path / "x.jpg"),
        lambda: case.place(float("nan")),
        lambda: ppa.Plan(depth={"roi_mm": -1}),
        lambda: ppa.Plan(rotation={"step_deg": 0}),
        lambda: ppa.Plan(positioning={"tilt_deg": 90}),
        lambda: ppa.Scene(ppa.Plan(), room="x.toml"),
        lambda: ppa.prepare(ppa.Volume(np.full((20, 20, 20), -1000, np.int16), np.eye(4)), "r"),
    ]:
        with pytest.raises(ValueError):
            call()


def test_refusals_name_keywords_and_no_options() -> None:
    rod = np.full((40, 40, 40), -1000, np.int16)
    rod[10:30, 10:30, :] = 50
    with pytest.raises(ppa.PpaError, match='joint centre with joint=, or limb="other"'):
        ppa.prepare(ppa.Volume(rod, np.diag([2.0, 2.0, 2.0, 1.0])), "r")


def test_pictures_are_drawn(case: ppa.Case, scene: ppa.Scene) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    pose = case.place(0, scene=scene)
    depth, radiograph = pose.depth(), pose.radiograph()
    for drawn in [case, pose, scene, depth, radiograph]:
        drawn.plot().figure.canvas.draw()
    for shown in [depth, radiograph]:
        assert shown._repr_png_().startswith(b"\x89PNG")
