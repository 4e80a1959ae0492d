"""Plots with matplotlib, which is imported for the first plot."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._ppa import Case, DepthImage, Pose, Radiograph, Scene

#: Half the side of the square part of the table that is drawn, mm.
_TABLE_MM = 400.0
#: Edge of the cubes whose vertices are merged for drawing a skin, mm.
_COARSE_MM = 8.0


def _axes(ax: Any, **options: Any) -> Any:
    if ax is not None:
        return ax
    pyplot: Any = importlib.import_module("matplotlib.pyplot")
    return pyplot.figure().add_subplot(**options)


def radiograph(image: Radiograph, ax: Any) -> Any:
    """Draw the picture in grey, with axes in mm on the detector."""
    axes = _axes(ax)
    rows, columns = image.total.shape
    width, height = columns * image.pixel_mm / 2, rows * image.pixel_mm / 2
    axes.imshow(image.picture(), cmap="gray", extent=(-width, width, height, -height))
    axes.set(xlabel="x of the detector / mm", ylabel="y of the detector / mm")
    return axes


def depth(image: DepthImage, ax: Any) -> Any:
    """Draw depths in colour; white where nothing is seen."""
    axes = _axes(ax)
    depths = np.ma.masked_equal(image.z_mm, 0)
    drawn = axes.imshow(depths, cmap="viridis_r")
    axes.figure.colorbar(drawn, ax=axes, label="depth / mm")
    axes.set(xlabel="column", ylabel="row")
    return axes


def _coarse(vertices: Any, triangles: Any) -> tuple[Any, Any]:
    """Replace the vertices in each cube by their mean: matplotlib draws some thousand triangles, but not 10⁵."""
    _, cube, count = np.unique(np.floor(vertices / _COARSE_MM), axis=0, return_inverse=True, return_counts=True)
    cube = cube.ravel()
    columns: list[Any] = [np.bincount(cube, column) / count for column in vertices.T]
    means: Any = np.stack(columns, axis=1)
    corners = cube[triangles]
    differ = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return means, corners[differ]


def _skin(axes: Any, vertices: Any, triangles: Any) -> None:
    coarse, corners = _coarse(vertices, triangles)
    axes.plot_trisurf(*coarse.T, triangles=corners, color="tan", alpha=0.5)
    axes.set_box_aspect(np.ptp(vertices, axis=0))
    axes.locator_params(nbins=4)


def case(limb: Case, ax: Any) -> Any:
    """Draw the skin in the scan with joint, axis and the points of the supporting plane."""
    axes = _axes(ax, projection="3d")
    _skin(axes, limb.vertices, limb.triangles)
    along = limb.axis[1] - limb.axis[0]
    ends = limb.joint + np.outer([-1.0, 2.0], along)
    axes.plot(*ends.T, color="tab:blue", label="axis")
    axes.scatter(*limb.joint, color="tab:red", label="joint")
    axes.scatter(*limb.plane.T, color="tab:green", label="plane")
    axes.set(xlabel="left / mm", ylabel="posterior / mm", zlabel="superior / mm")
    axes.legend(loc="upper left")
    return axes


def _room(axes: Any, room: Scene | Pose, limb: Any) -> Any:
    """Draw central beam and cameras in the room; the view also contains the points `limb`."""
    frames = room.frames
    device = frames["room_from_device"]
    beam = np.array([device @ (0.0, 0.0, z, 1.0) for z in (0.0, room.source_detector_mm)])[:, :3]
    axes.plot(*beam.T, color="tab:blue", label="central beam")
    for place, marker, name in zip(beam, "*s", ("x-ray source", "detector")):
        axes.scatter(*place, marker=marker, color="tab:blue", label=name)
    cameras = np.array([frames[f"room_from_{name}"][:3, 3] for name in ("left", "right")])
    for place, colour, name in zip(cameras, ("tab:orange", "tab:green"), ("left", "right")):
        axes.scatter(*place, color=colour, label=f"{name} camera")
    axes.set(xlabel="x / mm", ylabel="y / mm", zlabel="z / mm")
    everything = np.concatenate([limb, beam, cameras])
    axes.set_box_aspect(np.maximum(np.ptp(everything, axis=0), 1.0))
    axes.locator_params(nbins=4)
    axes.legend(loc="upper left")
    return axes


def pose(posed: Pose, ax: Any) -> Any:
    """Draw the skin in the room with x-ray source, detector and cameras."""
    axes = _axes(ax, projection="3d")
    vertices = posed.vertices
    _skin(axes, vertices, posed.triangles)
    return _room(axes, posed, vertices)


def scene(room: Scene, ax: Any) -> Any:
    """Draw the table around the central beam, with x-ray source, detector and cameras."""
    axes = _axes(ax, projection="3d")
    normal, offset = room.table[:3], room.table[3]
    source, ahead = room.frames["room_from_device"][:3, [3, 2]].T
    centre = source + (offset - normal @ source) / (normal @ ahead) * ahead
    along = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    along *= _TABLE_MM / np.linalg.norm(along)
    across = np.cross(normal, along)
    corners = centre + np.array([along + across, along - across, -along - across, across - along])
    axes.plot_trisurf(*corners.T, triangles=[[0, 1, 2], [0, 2, 3]], color="silver", alpha=0.5)
    return _room(axes, room, corners)
