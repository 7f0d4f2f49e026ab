"""Libraries for formats that few need: looked for when such a log comes, and the pip line where one is missing."""

import contextlib
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from eaid.errors import DataError

EXTRAS = {"nptdms": "tdms", "asammdf": "mdf", "rosbags": "ros", "pyarrow": "parquet"}
"""Library → the extra of eaid that brings it."""


def library(module: str, source: str, what: str) -> Any:
    """A module of a library in `EXTRAS`; raises DataError with the pip line where it is not installed."""
    name = module.partition(".")[0]
    try:
        return import_module(module)
    except ImportError:
        raise DataError(
            f'{source}: is a {what} file, which takes {name} to read; pip install "eaid[{EXTRAS[name]}]"'
        ) from None


@contextlib.contextmanager
def damage_told(source: str, what: str) -> Iterator[None]:
    """Turn whatever a library stumbles over in a file into the sentence that the file is damaged."""
    try:
        yield
    except DataError:
        raise
    except Exception as fault:  # what a library raises on bytes that it did not expect has no common type
        reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
        raise DataError(f"{source}: is a damaged {what} file ({reason}); copy or save it again") from None
