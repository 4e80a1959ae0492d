"""The examples in the book's section on other libraries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ppa


def test_tables_are_data_frames(labelled: Path) -> None:
    pandas = pytest.importorskip("pandas")
    samples = ppa.Dataset(labelled, side=32)
    table = pandas.DataFrame(samples.rows)
    assert len(table) == len(samples)
    assert table.groupby("angle_deg")["label"].mean().is_monotonic_increasing
    assert table["label"].to_numpy().tolist() == samples.labels.tolist()


def test_layers_are_a_dataset_of_xarray(case: ppa.Case, scene: ppa.Scene) -> None:
    xarray = pytest.importorskip("xarray")
    radiograph = case.place(0, scene=scene).radiograph()
    layers = xarray.Dataset({name: (("row", "column"), layer) for name, layer in radiograph.layers.items()})
    total = sum(layers[name] for name in layers)
    np.testing.assert_allclose(total, radiograph.total, rtol=1e-5)


def test_skins_are_meshes(case: ppa.Case, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    skin = trimesh.Trimesh(case.vertices, case.triangles)
    # Volume of a lower leg with its foot, mm³.
    assert 1e6 < skin.volume < 1e7
    meshio = pytest.importorskip("meshio")
    meshio.Mesh(case.vertices, [("triangle", case.triangles)]).write(tmp_path / "skin.vtk")
    read = meshio.read(tmp_path / "skin.vtk")
    np.testing.assert_array_equal(read.cells_dict["triangle"], case.triangles)


def test_images_are_exported_by_dlpack(case: ppa.Case, scene: ppa.Scene) -> None:
    pose = case.place(0, scene=scene)
    depth, radiograph = pose.depth(), pose.radiograph()
    for image, array in [(depth, depth.z_mm), (radiograph, radiograph.total)]:
        assert image.__dlpack_device__() == (1, 0)
        exported = np.from_dlpack(image)
        np.testing.assert_array_equal(exported, array)
        assert not np.shares_memory(exported, array)
    with pytest.raises(BufferError, match="export one of the layers"):
        radiograph.__dlpack__(copy=False)
    with pytest.raises(BufferError):
        depth.__dlpack__(copy=False)


@pytest.mark.skipif(np.lib.NumpyVersion(np.__version__) < "2.1.0", reason="numpy knows DLPack 1.0 from 2.1 on")
def test_views_are_exported_without_a_copy(case: ppa.Case, scene: ppa.Scene) -> None:
    pose = case.place(0, scene=scene)
    depth, layers = pose.depth(), pose.radiograph().layers
    for image, array in [(depth, depth.z_mm), (layers["primary"], layers["primary"])]:
        exported = np.from_dlpack(image, copy=False)
        assert np.shares_memory(exported, array)
        assert not exported.flags.writeable
    kept = np.from_dlpack(depth, copy=False)
    copied = depth.z_mm.copy()
    del depth
    np.testing.assert_array_equal(kept, copied)


def test_images_are_tensors(case: ppa.Case, scene: ppa.Scene, labelled: Path) -> None:
    torch = pytest.importorskip("torch")
    radiograph = case.place(0, scene=scene).radiograph()
    tensor = torch.from_dlpack(radiograph)
    np.testing.assert_array_equal(tensor.numpy(), radiograph.total)
    tensor.zero_()
    assert radiograph.total.all()
    layer = torch.tensor(radiograph.layers["primary"])
    np.testing.assert_array_equal(layer.numpy(), radiograph.layers["primary"])
    loader = torch.utils.data.DataLoader(
        ppa.Dataset(labelled, side=32, transform=torch.from_numpy), batch_size=4, num_workers=2)
    images, labels = next(iter(loader))
    assert images.shape == (4, 2, 32, 32)
    assert labels.dtype == torch.float64
