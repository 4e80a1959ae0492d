"""Conversion of SimpleITK and nibabel images; neither library is imported until it is needed."""

import importlib
import types
from typing import Any

import numpy as np
import numpy.typing as npt


def _library(image: Any) -> types.ModuleType:
    return importlib.import_module(type(image).__module__.partition(".")[0])


def _hounsfield(voxels: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Convert voxels to int16 if all are whole and in range, otherwise to float32; reoriented images are made contiguous."""
    if voxels.dtype == np.int16 or voxels.dtype == np.float32:
        return voxels if voxels.flags.forc else np.asfortranarray(voxels)
    if voxels.dtype.kind not in "iuf":
        raise ValueError(f"the voxels of the image are of type {voxels.dtype}, expected numbers")
    limits = np.iinfo(np.int16)
    fits = voxels.size > 0 and limits.min <= voxels.min() and voxels.max() <= limits.max
    if fits and (voxels.dtype.kind != "f" or bool(np.all(np.rint(voxels) == voxels))):
        return voxels.astype(np.int16, order="F")
    return voxels.astype(np.float32, order="F")


def parts(image: Any) -> tuple[npt.NDArray[Any], npt.NDArray[np.float64]]:
    """Return the voxels, indexed by (i, j, k), and the affine from voxel indices to LPS, mm."""
    affine = np.eye(4)
    if hasattr(image, "GetDirection") and hasattr(image, "GetSpacing"):
        if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
            raise ValueError(
                f"the image has {image.GetDimension()} dimensions and {image.GetNumberOfComponentsPerPixel()} "
                "components per pixel, expected 3 and 1"
            )
        voxels = np.transpose(_library(image).GetArrayViewFromImage(image))
        affine[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * np.array(image.GetSpacing())
        affine[:3, 3] = image.GetOrigin()
    elif hasattr(image, "dataobj") and hasattr(image, "affine"):
        voxels = np.asanyarray(image.dataobj)
        # NIfTI axes point right and anterior, LPS axes left and posterior.
        affine = np.diag([-1.0, -1.0, 1.0, 1.0]) @ np.asarray(image.affine, dtype=np.float64)
    else:
        raise TypeError(f"the image is of type {type(image).__name__}, expected one of SimpleITK or nibabel")
    if voxels.ndim != 3:
        raise ValueError(f"the image has the shape {voxels.shape}, expected three dimensions")
    return _hounsfield(voxels), affine


def to_simpleitk(voxels: npt.NDArray[Any], affine: npt.NDArray[np.float64]) -> Any:
    """Convert to a SimpleITK image, with orthogonal or sheared axes as in the affine."""
    sitk = importlib.import_module("SimpleITK")
    image = sitk.GetImageFromArray(np.transpose(voxels))
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetOrigin(affine[:3, 3].tolist())
    image.SetDirection((affine[:3, :3] / spacing).ravel().tolist())
    return image


def to_nibabel(voxels: npt.NDArray[Any], affine: npt.NDArray[np.float64]) -> Any:
    """Convert to a nibabel NIfTI image."""
    nibabel = importlib.import_module("nibabel")
    return nibabel.Nifti1Image(voxels, np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine)
