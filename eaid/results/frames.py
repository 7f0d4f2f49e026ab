"""Results as rows of a table."""

import math
from collections.abc import Iterable

import msgspec
import pandas

from eaid.results.codec import holds_part

Cell = float | int | str | bool


def cells_of(item: msgspec.Struct) -> dict[str, Cell]:
    """The fields of a result that are no parts of their own, by their keys; of intervals `ci95` both ends."""
    cells: dict[str, Cell] = {}
    for name, key in zip(item.__struct_fields__, item.__struct_encode_fields__, strict=True):
        value = getattr(item, name)
        if holds_part(type(item), name):
            ends = value.__struct_fields__ if name == "ci95" and value is not None else ()
            for one in (each for each in ends if each != "dof"):
                low, high = getattr(value, one) or (math.nan, math.nan)
                cells |= {f"{one}_low": low, f"{one}_high": high}
        elif value is None or isinstance(value, Cell):
            cells[key] = math.nan if value is None else value
    return cells


def frame_of(items: Iterable[msgspec.Struct]) -> pandas.DataFrame:
    """One row a result, one column a field."""
    return pandas.DataFrame([cells_of(item) for item in items])
