"""Volumes return the values that were put in, without unnecessary copies."""

from __future__ import annotations

import gc
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import ppa

AFFINE = np.array([[-0.5, 0, 0, 10], [0, 0.7, 0.1, -20], [0, 0, 2.0, 30], [0, 0, 0, 1]])


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_voxels_keep_values_type_and_place(order: Any, dtype: Any) -> None:
    voxels = np.arange(2 * 3 * 4).reshape(2, 3, 4).astype(dtype, order=order)
    volume = ppa.Volume(voxels, AFFINE)
    assert volume.shape == (2, 3, 4)
    assert volume.voxels.dtype == dtype
    np.testing.assert_array_equal(volume.voxels, voxels)
    np.testing.assert_array_equal(volume.affine, AFFINE)


def test_voxels_are_a_view_that_keeps_its_volume_alive() -> None:
    volume = ppa.Volume(np.full((50, 60, 70), 7, np.int16), np.eye(4))
    first, second = volume.voxels, volume.voxels
    assert np.shares_memory(first, second)
    assert not first.flags.owndata
    assert not first.flags.writeable
    with pytest.raises(ValueError):
        first[0, 0, 0] = 1
    with pytest.raises(ValueError):
        first.flags.writeable = True
    del volume, second
    gc.collect()
    assert int(first.sum()) == 7 * first.size


def test_a_case_shares_the_voxels_of_its_volume(volume: ppa.Volume, case: ppa.Case) -> None:
    assert np.shares_memory(volume.voxels, case.volume.voxels)


def test_files_hold_the_volume(tmp_path: Path) -> None:
    voxels = np.arange(-1000, -1000 + 24, dtype=np.int16).reshape(2, 3, 4)
    affine = np.array([[-0.5, 0, 0, 10], [0, 0.75, 0, -20], [0, 0, 2.0, 30], [0, 0, 0, 1]])
    volume = ppa.Volume(voxels, affine)
    for name in ["v.nii.gz", "v.nrrd", "v.mha"]:
        volume.save(tmp_path / name)
        read = ppa.Volume.read(tmp_path / name)
        assert Path(str(read.path)) == tmp_path / name
        assert read.sha256 == volume.sha256


def test_nibabel_images_are_volumes(tmp_path: Path, volume: ppa.Volume) -> None:
    nibabel = pytest.importorskip("nibabel")
    path = tmp_path / "p.nii"
    volume.save(path)
    read, converted = ppa.Volume.read(path), ppa.Volume.from_image(nibabel.load(path))
    np.testing.assert_array_equal(read.voxels, converted.voxels)
    np.testing.assert_allclose(read.affine, converted.affine, atol=1e-6)
    back = volume.to_nibabel()
    assert np.shares_memory(np.asanyarray(back.dataobj), volume.voxels)


@pytest.mark.parametrize("dtype", [np.int16, np.float32, np.float64])
def test_turned_nibabel_images_are_volumes(dtype: Any) -> None:
    nibabel = pytest.importorskip("nibabel")
    voxels = np.arange(2 * 3 * 4).reshape(2, 3, 4).astype(dtype)
    affine = np.array([[0, 0, -2.0, 30], [-0.5, 0, 0, 10], [0, 0.7, 0, -20], [0, 0, 0, 1]])
    turned = nibabel.as_closest_canonical(nibabel.Nifti1Image(voxels, affine))
    assert not np.asanyarray(turned.dataobj).flags.forc
    volume = ppa.Volume.from_image(turned)
    np.testing.assert_array_equal(volume.voxels, np.asanyarray(turned.dataobj))
    for index in np.ndindex(2, 3, 4):
        at = np.linalg.solve(volume.affine, np.diag([-1, -1, 1, 1]) @ affine @ (*index, 1))[:3]
        assert volume.voxels[tuple(np.rint(at).astype(int))] == voxels[index]


def test_simpleitk_images_are_volumes(volume: ppa.Volume) -> None:
    pytest.importorskip("SimpleITK")
    image = ppa.Volume(np.arange(24, dtype=np.int16).reshape(2, 3, 4), AFFINE_RIGHT).to_simpleitk()
    assert image.GetSize() == (2, 3, 4)
    assert image.GetPixel(1, 2, 3) == 23
    again = ppa.Volume.from_image(image)
    assert again.voxels.dtype == np.int16
    np.testing.assert_allclose(again.affine, AFFINE_RIGHT, atol=1e-12)
    assert again.voxels[1, 2, 3] == 23


AFFINE_RIGHT = np.array([[0, -0.5, 0, 10], [0.7, 0, 0, -20], [0, 0, 2.0, 30], [0, 0, 0, 1]])


def test_blocks_outside_a_volume_are_refused() -> None:
    volume = ppa.Volume(np.zeros((4, 5, 6), np.int16), np.eye(4))
    assert volume.crop((1, 1, 1), (4, 5, 6)).shape == (3, 4, 5)
    for low, high, says in [
        ((0, 0, 0), (4, 9, 6), "ends before voxel 9 along j, but the volume has only 5 along that axis"),
        ((2, 0, 0), (2, 5, 6), "0 x 5 x 6 voxels is empty"),
        ((-1, 0, 0), (2, 5, 6), "found (-1, 0, 0), expected whole numbers from 0 to 18446744073709551615"),
        ((0, 0, 2**64), (2, 5, 6), "found (0, 0, 18446744073709551616)"),
    ]:
        with pytest.raises(ValueError) as refused:
            volume.crop(low, high)
        assert says in str(refused.value)


def test_importing_ppa_imports_neither_numpy_nor_others() -> None:
    import subprocess

    names = ["numpy", "torch", "SimpleITK", "nibabel", "matplotlib", "tqdm"]
    code = f"import sys, ppa; print([n for n in {names} if n in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("voxels", "affine", "kind", "says"),
    [
        ([[[1]]], np.eye(4), TypeError, "voxels is of type list, expected a numpy array"),
        (np.zeros((2, 2, 2)), np.eye(4), ValueError, "float64 of shape (2, 2, 2), expected int16 or float32"),
        (np.zeros((2, 2), np.int16), np.eye(4), ValueError, "expected int16 with 3 dimensions"),
        (np.zeros((4, 4, 4), np.int16)[::2], np.eye(4), ValueError, "not contiguous"),
        (np.frombuffer(bytearray(17), np.int16, 8, 1).reshape(2, 2, 2), np.eye(4), ValueError, "is not aligned to the size"),
        (np.full((2, 2, 2), np.nan, np.float32), np.eye(4), ValueError, "voxel (0, 0, 0) holds a value that is not a number"),
        (np.zeros((2, 2, 2), np.int16), np.eye(3), ValueError, "affine has the shape (3, 3), expected (4, 4)"),
        (np.zeros((2, 2, 2), np.int16), np.full((4, 4), np.nan), ValueError, "affine contains NaN"),
        (np.zeros((2, 2, 2), np.int16), np.zeros((4, 4)), ValueError, "last row of affine"),
        (np.zeros((2, 2, 2), np.int16), np.diag([1.0, 1, 0, 1]), ValueError, "singular"),
        (np.zeros((0, 2, 2), np.int16), np.eye(4), ValueError, "empty"),
    ],
)
def test_what_is_no_volume_is_refused(voxels: Any, affine: Any, kind: Any, says: str) -> None:
    with pytest.raises(kind) as refused:
        ppa.Volume(voxels, affine)
    assert says in str(refused.value)


arrays = hnp.arrays(
    dtype=st.one_of(
        hnp.integer_dtypes(), hnp.floating_dtypes(), hnp.boolean_dtypes(), hnp.complex_number_dtypes(),
        hnp.byte_string_dtypes(), hnp.datetime64_dtypes(),
    ),
    shape=hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4),
)


@given(array=arrays, step=st.sampled_from([-1, 1, 2]), swap=st.booleans(), affine=st.one_of(
    st.just(np.eye(4)), hnp.arrays(np.float64, (4, 4)), st.none(), st.text()))
@settings(max_examples=300, deadline=None)
def test_any_array_is_a_volume_or_an_exception(array: Any, step: int, swap: bool, affine: Any) -> None:
    voxels = array[..., ::step] if array.ndim else array
    voxels = voxels.T if swap else voxels
    try:
        volume = ppa.Volume(voxels, affine)
    except (ValueError, TypeError):
        return
    np.testing.assert_array_equal(volume.voxels, voxels)
