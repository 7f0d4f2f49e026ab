"""Readers on anything at all: any table comes back digit by digit; of random or mutated files only refusals come."""

import gzip
import re
from pathlib import Path
from typing import Any

import logs_written as written
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import eaid
from eaid import DataError, EaidError

pytestmark = pytest.mark.slow  # the tables of the other files hold what once came of it


def many(count: int) -> Any:
    return settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=count)


@many(400)
@given(
    values=st.lists(st.floats(-1e12, 1e12).map(lambda x: x * (abs(x) > 1e-90)), min_size=12, max_size=40),
    between=st.sampled_from([",", ";", "\t", "|", "  "]), decimal=st.sampled_from([".", ","]),
    end=st.sampled_from(["\n", "\r\n", "\r"]), encoding=st.sampled_from(["utf-8-sig", "utf-16", "latin-1", "gzip"]),
    remark=st.booleans(), order=st.permutations(["time_s", "torque_nm", "note"]),
)  # fmt: skip
def test_any_table_in_any_dialect(read, values, between, decimal, end, encoding, remark, order):
    if between == decimal:
        return
    columns = {"time_s": range(len(values)), "torque_nm": values, "note": [0.5] * len(values)}
    cells = [[repr(v).replace(".", decimal) for v in columns[name]] for name in order]
    content = "# a rig" * remark + end * remark + written.text(",".join(order), *cells, between=between, end=end)
    raw = gzip.compress(content.encode()) if encoding == "gzip" else content.encode(encoding)
    run = read(raw)
    assert run.output.tolist() == values and run.time_s.tolist() == list(range(len(values)))


CELL = st.text(st.characters(codec="ascii", exclude_characters="\r\n", exclude_categories=("Cc",)), max_size=12)
NEARLY = st.builds(lambda a, b, c: a + b + c, st.sampled_from(["", "-", "+", " ", '"']),
                   st.from_regex(r"[0-9]{0,4}[.,]?[0-9]{0,3}([eEdD][+-]?[0-9]{1,3})?", fullmatch=True),
                   st.sampled_from(["", " ", "x", "_1", "%", '"', " 2", "\t"]))  # fmt: skip


def meaning(cell: str) -> float | None:
    """What a cell means where the decimal mark is a point, by the simplest rule; None where it means nothing."""
    bare = cell.strip().strip('"').strip()
    if not re.fullmatch(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?", bare):
        return None
    value = float(bare)
    return value if np.isfinite(value) else None


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers as 1e200 in the search for steps
@many(800)
@given(cell=CELL | NEARLY, row=st.integers(0, 199), column=st.integers(1, 2), remark=st.booleans())
def test_a_mutated_cell_is_read_as_it_stands_or_refused(read, cell, row, column, remark):
    step = [column[100:300] for column in written.step(400)]
    cells = [[f"{a:.4f}", f"{b:g}", f"{c:.6f}"] for a, b, c in zip(*step, strict=True)]
    cells[row][column] = cell
    content = written.text("time_s,duty_pct,torque_nm", *zip(*cells, strict=True)) + "# the end\n" * remark
    cell = re.sub(r',[\s"]*$', "", cell) if column == 2 else cell  # a row may end with a delimiter
    try:
        run = read(content)
    except DataError as refusal:
        assert f"row {row + 2}" in str(refusal) or meaning(cell) is not None  # noqa: PT017
        return
    cells[row][column] = cell
    wanted = np.array([[meaning(one) for one in line] for line in cells], dtype=object)
    assert ("," not in cell or '"' in cell) and wanted[row, column] is not None
    np.testing.assert_allclose(run.time_s + run.start_s, wanted[:, 0].astype(float), atol=1e-12)
    np.testing.assert_array_equal((run.input, run.output), wanted[:, 1:].astype(float).T)


def only_refusals(folder: Path, contents: list[bytes]) -> None:
    """All files of one call, in which one process reads what is binary: each is read, or refused by its name."""
    paths = [folder / f"log{k}" for k in range(len(contents))]
    for path, content in zip(paths, contents, strict=True):
        path.write_bytes(content)
    try:
        eaid.read(paths, logs_as="recorded")
    except EaidError as refusal:
        assert all(said.startswith(tuple(map(str, paths))) and "\n" not in said for said in refusal.sentences)  # noqa: PT017


MAGIC = (
    b"\x89HDF\r\n\x1a\n", b"TDSm\x0e\x00\x00\x00\x69\x12\x00\x00", b"PAR1",
    b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM\x0f\x00\x00\x00",
    b"\x93NUMPY\x01\x00", b"LabVIEW Measurement\t\n",
)  # fmt: skip


PLAIN = st.sampled_from([b"", b"\x1f\x8b\x08\x00", b"\xff\xfe", b"PK\x03\x04", b"time,torque\n"])


@many(300)
@given(magic=PLAIN, rest=st.binary(max_size=600))
def test_random_bytes(tmp_path, magic, rest):
    only_refusals(tmp_path, [magic + rest])


@many(20)
@given(rests=st.lists(st.binary(max_size=600), min_size=len(MAGIC), max_size=len(MAGIC)))
def test_random_bytes_in_a_binary_file(tmp_path, rests):
    only_refusals(tmp_path, [magic + rest for magic, rest in zip(MAGIC, rests, strict=True)])
