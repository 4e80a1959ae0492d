"""Datasets in other processes."""

from typing import Any

from ._ppa import Dataset


def open_dataset(arguments: dict[str, Any]) -> Dataset:
    """Open a dataset again, as pickle does in the workers of a data loader."""
    return Dataset(**arguments)
