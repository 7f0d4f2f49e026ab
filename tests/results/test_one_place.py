"""A field of a result is declared in one place: codec, table and the check of the docs go by its type."""

import re
from pathlib import Path

import msgspec
import numpy as np

from eaid.results import codec
from eaid.results.common import Interval, Number
from eaid.results.fit import Fit, Friction, FrictionLevel, LevelIntervals
from eaid.results.frames import cells_of

EAID = Path(__file__).parents[2] / "eaid"


class MoreIntervals(LevelIntervals, frozen=True):
    """A field more."""

    wobble: Interval = None


class MoreLevel(FrictionLevel, frozen=True):
    """A field more."""

    wobble: Number | None = None
    note: str = ""


ROW = MoreLevel(60.0, 1.6, 0.6, 15.0, wobble=0.25, ci95=MoreIntervals(Ts=(1.5, 1.7), wobble=(0.2, 0.3)))


def test_a_new_field_is_written_read_and_tabled_without_another_line() -> None:
    fit = Fit(friction=Friction(levels=(ROW,)))
    plain = codec.to_plain(fit)["friction"]["levels"][0]
    assert (plain["wobble"], plain["ci95"]["wobble"]) == (0.25, [0.2, 0.3])
    assert codec.from_plain(plain | {"ci95": None}, MoreLevel, "x") == msgspec.structs.replace(ROW, ci95=None)
    (row,) = fit.to_frame().to_dict("records")
    assert (row["wobble"], row["wobble_low"], row["Ts_high"], row["note"]) == (0.25, 0.2, 1.7, "")


def test_a_new_field_is_asked_for_in_the_docs() -> None:
    """`tests/test_docs.py` walks the keys of the file: one that no row of docs/files.md names is a fault there."""
    import sys

    sys.path.insert(0, str(EAID.parent / "tests"))
    from test_docs import explained, keys

    known = explained("fit.json")
    found = set(keys(codec.to_plain(Fit(friction=Friction(levels=(ROW,)))))) - set(
        keys(codec.to_plain(Fit(friction=Friction(levels=(FrictionLevel(60.0, 1.6, 0.6, 15.0),)))))
    )
    named = {key for key in found if any(one.fullmatch(key) for one in known)}
    assert "friction.levels[].wobble" in found - named


def test_cells_leave_out_parts_and_say_nan_where_nothing_is_known() -> None:
    cells = cells_of(FrictionLevel(60.0, 1.6, 0.6, 15.0))
    assert "solver" not in cells and "ci95" not in cells
    assert np.isnan(cells["rmse"]) and cells["from"] == 0.0


def test_dicts_of_anything_stand_in_the_codec_only() -> None:
    rooms = [EAID / name for name in ("cli", "results", "api", "findings")]
    files = [path for room in rooms for path in room.rglob("*.py")] + [EAID / "reading.py", EAID / "files.py"]
    loose = re.compile(r"dict\[str, (Any|object)\]")
    assert {path.name for path in files if loose.search(path.read_text(encoding="utf-8"))} == {"codec.py"}
