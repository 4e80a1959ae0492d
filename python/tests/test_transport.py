"""Transport through voxels of one's own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ppa

AFFINE = np.diag([5.0, 5.0, 5.0, 1.0])
AFFINE[:3, 3] = -22.5
#: The source 1 m below the origin of the ct frame along z.
POSE = np.eye(4)
POSE[2, 3] = -1000.0
XRAY = {"detector": {"columns": 16, "rows": 12, "pixel_mm": 8.0}}


def cube(**changes: Any) -> ppa.Transport:
    arguments: dict[str, Any] = {
        "material": np.zeros((10, 10, 10), np.uint8),
        "density_g_cm3": np.ones((10, 10, 10), np.float32),
        "materials": ["water"],
        "affine": AFFINE,
    }
    return ppa.Transport(**{**arguments, **changes})


def test_the_primary_behind_water_is_that_of_the_law() -> None:
    radiograph = cube().radiograph(
        POSE, 1100.0, spectrum=ppa.Spectrum.monoenergetic(60.0), xray=XRAY, histories=float("inf"))
    behind = radiograph.layers["primary"][5:7, 7:9] / radiograph.open_field[5:7, 7:9]
    expected = np.exp(-5.0 * ppa.Material("water").total_cm2_g(60.0))
    np.testing.assert_allclose(behind, expected, rtol=2e-3)
    assert radiograph.total.shape == (12, 16)
    assert radiograph.mas is None
    assert np.isinf(radiograph.histories)


def test_both_engines_agree() -> None:
    sums = {}
    for engine, histories in [("fast", float("inf")), ("analog", 400_000)]:
        sums[engine] = cube().radiograph(POSE, 1100.0, xray=XRAY, engine=engine, histories=histories).sums
    for part in ["primary", "compton", "rayleigh", "multiple"]:
        fast, analog = (sums[engine][f"{part}_ev_per_history"] for engine in ("fast", "analog"))
        error = np.hypot(*(sums[engine][f"{part}_ev_per_history_se"] for engine in ("fast", "analog")))
        assert abs(fast - analog) < 5 * error, part


def test_the_order_in_memory_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    density = rng.uniform(0.5, 2, (10, 10, 10)).astype(np.float32)
    images = [
        cube(density_g_cm3=np.asarray(density, order=order)).radiograph(POSE, 1100.0, xray=XRAY).total
        for order in ("C", "F")
    ]
    np.testing.assert_array_equal(*images)


def test_voxels_of_a_ct_give_dose_and_error() -> None:
    hu = np.full((10, 10, 10), 50, np.int16)
    mask = np.ones(hu.shape, bool)
    mask[:5] = False
    transport = ppa.Transport.of_volume(ppa.Volume(hu, AFFINE), mask=mask)
    assert "air" in transport.materials
    radiograph = transport.radiograph(POSE, 1100.0, xray=XRAY, engine="analog", histories=50_000, dose="map")
    assert radiograph.dose_map().shape == (10, 10, 10)
    behind_air, behind_water = radiograph.total[4:8, 5:7], radiograph.total[4:8, 9:11]
    assert behind_air.mean() > 1.5 * behind_water.mean()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"material": np.zeros((10, 10, 10), np.int64)}, "material is an array of int64"),
        ({"material": np.ones((10, 10, 10), np.uint8)}, "names material 1, but there are 1"),
        ({"material": np.zeros((10, 10, 9), np.uint8)}, "expected the same"),
        ({"density_g_cm3": np.ones((20, 10, 10), np.float32)[::2]}, "density_g_cm3 is not contiguous"),
        ({"density_g_cm3": np.full((10, 10, 10), np.nan, np.float32)}, "density of NaN"),
        ({"density_g_cm3": np.full((10, 10, 10), -1, np.float32)}, "density of -1"),
        ({"materials": []}, "0 materials"),
        ({"materials": ["gold?"]}, "gold?"),
        ({"affine": np.zeros((4, 4))}, "last row"),
        ({"interpolation": "cubic"}, "interpolation"),
    ],
)
def test_voxels_that_make_no_sense_are_refused(changes: Any, says: str) -> None:
    with pytest.raises(ValueError) as refused:
        cube(**changes)
    assert says in str(refused.value)
    with pytest.raises(ValueError, match="device|rotation|rigid|matrix"):
        cube().radiograph(np.diag([2.0, 1, 1, 1]), 1100.0, xray=XRAY)
