"""Numbers of a fixed count of decimals: the bits of float(), or left to the other readers."""

import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from eaid.logs import text
from eaid.logs.dialect import Dialect
from eaid.logs.ruled import ROWS, ruled


def read(body: str | bytes, columns: int = 3, wanted=(0, 1, 2), delimiter: str = ","):
    data = body.encode() if isinstance(body, str) else body
    return ruled(np.frombuffer(data, dtype=np.uint8), columns, delimiter, wanted)


def same_bits(found, rows: list[list[str]], wanted=(0, 1, 2)) -> bool:
    return found is not None and all(
        column.tobytes() == np.array([float(row[k]) for row in rows]).tobytes()
        for column, k in zip(found, wanted, strict=True)
    )


def written(count: int, decimals: tuple[int, ...], seed: int = 0) -> list[list[str]]:
    """Rows as a logger prints them: a clock, a duty, a torque of either sign."""
    rng = np.random.default_rng(seed)
    values = zip(np.arange(count) * 1e-3, 10.0 * rng.integers(0, 11, count), rng.normal(0, 2, count), strict=True)
    return [[f"{x:.{d}f}" for x, d in zip(row, decimals, strict=True)] for row in values]


@pytest.mark.parametrize("decimals", [(3, 0, 6), (4, 1, 3), (6, 2, 9), (0, 0, 0), (1, 11, 13)])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_the_bits_are_those_of_float(decimals, line_end):
    rows = written(5000, decimals)
    body = line_end.join(",".join(row) for row in rows)
    assert same_bits(read(body), rows)
    assert same_bits(read(body, wanted=(2, 0)), rows, (2, 0))


def test_several_pieces_and_another_delimiter():
    rows = written(2 * ROWS + 17, (3, 0, 5))
    assert same_bits(read("\n".join(";".join(row) for row in rows), delimiter=";"), rows)


figures = st.text(st.sampled_from("0123456789"), min_size=1, max_size=15)
cell = st.builds(lambda sign, whole, point, rest: sign + whole + point + rest, st.sampled_from(["", "-", "+"]), figures,
                 st.sampled_from(["", "."]), st.text(st.sampled_from("0123456789"), max_size=15))  # fmt: skip


@given(st.tuples(cell, cell, cell), st.integers(1, 3))
@example(("-0.000", "+.5", "5."), 1)
def test_any_number(row, count):
    found = read("\n".join([",".join(row)] * count))
    if all(sum(c.isdigit() for c in one) <= 15 for one in row):
        assert same_bits(found, [list(row)] * count)
    else:
        assert found is None


@given(st.lists(st.tuples(cell, cell, cell), min_size=1, max_size=8))
def test_any_rows_are_right_or_left_to_others(rows):
    found = read("\n".join(",".join(row) for row in rows))
    assert found is None or same_bits(found, rows)


@given(st.lists(st.floats(-9e5, 9e5), min_size=2, max_size=30), st.integers(0, 9))
def test_any_doubles_with_so_many_decimals(values, decimals):
    rows = [[f"{x:.{decimals}f}", "0", "1"] for x in values][:10]
    assert same_bits(read("\n".join(",".join(row) for row in rows)), rows)


@pytest.mark.parametrize(
    "odd",
    [
        "", "1,2", "1,2,3,4", "1,2,", "1,,3", "1,2,nan", "1,2,inf", "1,2,1e5", "1,2,0x1", "1,2,1_0", '1,2,"3"',
        "1,2, 3", "1,2,3 ", "1,2,-", "1,2,.", "1,2,+", "1,2,1.2.3", "1,2,--3", "1,2,3-", "1,2,1/2", "# note", "1;2;3",
        "1,2,\x003", "1,2,1234567890123456", "1,2,٣", "1,2,:", "1,2,D", "1,2,3\r", "a,b,c", "-,-,-", ",,",
    ],
)  # fmt: skip
@pytest.mark.parametrize("place", [0, 7, 4999])
def test_anything_else_is_left_to_others(odd, place):
    lines = [",".join(row) for row in written(5000, (3, 0, 6))]
    assert read("\n".join([*lines[:place], odd, *lines[place:]])) is None
    assert read("\n".join([*lines[:place], *lines[place + 1 :]])) is not None
    assert read(odd.encode() or b"\n") is None


def test_marks_that_change_places_with_each_other_are_seen():
    assert read("1.5,2,3\n1,5.2,3") is None
    assert read("-5,2,3\n.5,2,3") is None
    assert read("-5,2,3\n+5,2,3") is None
    assert read("1.5,2,3\n15.,2,3") is not None


def test_wide_rows():
    many = [[f"{x:.2f}" for x in np.random.default_rng(k).normal(0, 9, 20)] for k in range(8)]
    assert same_bits(read("\n".join(",".join(row) for row in many), 20), many)
    odd = "\n".join(["1" * 7 + "," + "," * k + "1" * (140 - k) for k in (1, 130)])
    assert read(odd, 3) is None
    assert read("1,2," + "3" * 300) is None


def dialect(columns: int = 3, delimiter: str | None = ",", **changes) -> Dialect:
    names = tuple("abcdefgh"[:columns])
    return Dialect(**{"encoding": "utf-8", "delimiter": delimiter, "decimal": ".", "thousands": "", "columns": names,
                      "units": (), "first_line": 1} | changes)  # fmt: skip


def numpy_way(body: str, wanted=(0, 1, 2), **changes):
    data = b"head\n" + body.encode() + b"\n \n"
    return text._load_numpy(data, 5, 5 + len(body.encode()), dialect(**changes), wanted)


@given(st.lists(st.tuples(*[st.floats(-1e300, 1e300)] * 3), min_size=1, max_size=20),
       st.sampled_from(["{!r}", "{:.17g}", "{:g}", "{:+.9e}", "{:.3f}"]))  # fmt: skip
def test_numpys_parser_gives_the_bits_of_float(rows, form):
    cells = [[form.format(x) for x in row] for row in rows]
    found = numpy_way("\n".join(",".join(row) for row in cells), wanted=(2, 0))
    assert same_bits(found and found.values, cells, (2, 0))
    found = numpy_way("\r\n".join("  ".join(row) for row in cells), delimiter=None)
    assert same_bits(found and found.values, cells)


@pytest.mark.parametrize(
    "odd", ["", "1,2", "1,2,3,4", "1,,3", "1,2,nan", "1,2,-inf", "1,2,1e400", "1,2,1_0", "1,2,x", "1,2,1d5", "# note",
            '1,2,"3"'],
)  # fmt: skip
def test_what_numpy_would_pass_over_is_not_taken(odd):
    good = "0.5,1e-3,7\n" * 5
    assert numpy_way(good.strip()) is not None
    assert numpy_way(good + odd + "\n" + good.strip()) is None


def test_a_row_too_short_does_not_make_up_for_one_too_long():
    assert numpy_way("1,2,3\n1,2\n1,2,3,4\n1,2,3", wanted=(0, 1)) is None


def test_pandas_is_taken_once_it_is_there_or_much_is_read(monkeypatch):
    asked = []
    monkeypatch.setattr(text, "_load_pandas", lambda *_: asked.append("pandas"))
    monkeypatch.setattr(text, "_load_numpy", lambda *_: asked.append("numpy"))
    monkeypatch.setattr(text, "_read_bytes", 0)
    monkeypatch.setattr(text, "PANDAS_BYTES", 100)
    given = {k: v for k, v in sys.modules.items() if k != "pandas"}
    monkeypatch.setattr(text.sys, "modules", given)
    for _ in range(4):
        text._load_fast(b"", 0, 40, dialect(), (0,))
    text._load_fast(b"", 0, 1, dialect(decimal=","), (0,))
    given["pandas"] = None
    text._load_fast(b"", 0, 1, dialect(), (0,))
    assert asked == ["numpy", "numpy", "pandas", "pandas", "pandas", "pandas"]
