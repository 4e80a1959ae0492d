"""Reopening of datasets in other processes."""

from typing import Any

from ._ppa import Dataset


def open_dataset(arguments: dict[str, Any]) -> Dataset:
    """Reopen a dataset, for pickle in the workers of a data loader."""
    return Dataset(**arguments)
