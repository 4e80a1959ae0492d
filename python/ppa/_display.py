"""Images for display in notebooks."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._ppa import DepthImage, Radiograph


def radiograph(image: Radiograph) -> bytes:
    """Encode the picture as PNG."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "radiograph.png"
        image.save(path)
        return path.read_bytes()


def depth(image: DepthImage) -> bytes:
    """Encode the image in false colour as PNG."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "depth.png"
        image.save_preview(path)
        return path.read_bytes()
