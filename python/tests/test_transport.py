"""Transport through user-defined voxels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import ppa

AFFINE = np.diag([5.0, 5.0, 5.0, 1.0])
AFFINE[:3, 3] = -22.5
#: Pose of the device, with the source 1 m below the origin of the ct frame along z.
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
        ({"material": np.ones((10, 10, 10), np.uint8)}, "has material index 1, but the number of materials is 1"),
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


#: Strategies for arguments: valid ones, and arrays of any type and shape.
any_array = hnp.arrays(
    dtype=st.one_of(hnp.unsigned_integer_dtypes(), hnp.floating_dtypes(), hnp.boolean_dtypes(), hnp.byte_string_dtypes()),
    shape=hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=3),
)
any_matrix = st.one_of(st.just(POSE), st.just(AFFINE), hnp.arrays(np.float64, (4, 4)), any_array, st.none(), st.text())


@given(
    material=st.one_of(hnp.arrays(np.uint8, (3, 3, 3), elements=st.integers(0, 1)), any_array),
    density=st.one_of(hnp.arrays(np.float32, (3, 3, 3)), any_array),
    materials=st.lists(st.one_of(st.sampled_from(["water", "air"]), st.text(), st.none()), max_size=3),
    affine=any_matrix,
)
@settings(max_examples=300, deadline=None)
def test_any_arrays_are_voxels_or_an_exception(material: Any, density: Any, materials: Any, affine: Any) -> None:
    try:
        transport = ppa.Transport(material, density, materials, affine)
    except (ValueError, TypeError):
        return
    assert material.shape == density.shape and set(transport.materials) <= set(materials)


common = {"seed": st.integers(), "threads": st.integers(-1, 2)}
any_exposure = st.one_of(
    st.fixed_dictionaries({}, optional={
        "histories": st.floats(), "mas": st.floats(), "exposure_index": st.floats(), "target_error": st.floats(), **common}),
    st.fixed_dictionaries({"engine": st.just("analog"), "histories": st.floats(max_value=1e4)}, optional={
        "target_error": st.floats(), "seconds": st.floats(), "dose": st.sampled_from([True, "map", ""]), **common}),
)


@given(pose=any_matrix, distance=st.floats(), columns=st.integers(-2, 9), pixel_mm=st.floats(), exposure=any_exposure)
@settings(max_examples=200, deadline=None)
def test_any_exposure_is_a_radiograph_or_an_exception(
    pose: Any, distance: float, columns: int, pixel_mm: float, exposure: Any
) -> None:
    xray = {"detector": {"columns": columns, "rows": 3, "pixel_mm": pixel_mm}, "engine": {"scatter_histories": 100}}
    try:
        radiograph = cube().radiograph(pose, distance, xray=xray, **exposure)
    except (ValueError, TypeError):
        return
    assert radiograph.total.shape == (3, columns)
    assert np.isfinite(radiograph.total).all()
