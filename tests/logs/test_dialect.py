"""What is header, unit, remark, stamp and number in a text log, line by line."""

import math

import numpy as np
import pytest

from eaid.errors import DataError
from eaid.logs.dialect import Marks, encoding_of, has_table, lines_of, sniff
from eaid.logs.read import read_runs
from eaid.logs.table import BadCell
from eaid.logs.text import _day, _lines, _pieces, _stripped, by_arrow, cell_by_cell

ROWS = "0,1,2\n1,2,3\n2,3,4\n3,4,5\n"


@pytest.mark.parametrize(
    ("above", "columns", "units", "said"),
    [
        ("", ",,", ",,", {}),
        ("time,u,y\n", "time,u,y", ",,", {}),
        ("time,u,y\n\n", "time,u,y", ",,", {}),
        ("\n\ntime,u,y\n", "time,u,y", ",,", {}),
        ("time,u,y\ns,%,Nm\n", "time,u,y", "s,%,Nm", {}),
        ("time,u,y\ns,,Nm\n", "time,u,y", "s,,Nm", {}),
        ("time,u,y\n[s],-,(Nm)\n", "time,u,y", "s,,Nm", {}),
        ("time,u,y\n[a],-,(b)\n", "time,u,y", "a,,b", {}),  # in brackets, whatever they are
        ("s,V,Nm\n", "s,V,Nm", ",,", {}),  # names that are called like units
        ("s,V,Nm\nms,mV,N\n", "ms,mV,N", ",,", {"s": "V"}),
        ("time,u,y\na,b,c\n", "a,b,c", ",,", {"time": "u"}),
        ("rig,3\ntime,u,y\ns,%,Nm\n", "time,u,y", "s,%,Nm", {"rig": "3"}),
        ("one,two,three\ntime,u,y\ns,%,Nm\n", "time,u,y", "s,%,Nm", {"one": "two"}),
        ("# time,u,y\n", "time,u,y", ",,", {}),
        ("# note: x\n# time,u,y\n# s,V,Nm\n", "time,u,y", "s,V,Nm", {"note": "x"}),
        ("% made by hand\ntime,u,y\n", "time,u,y", ",,", {"": "made by hand"}),
        ("time,u,y\n# rig: 2\n", ",,", ",,", {"time": "u", "rig": "2"}),  # a remark between parts them
        ('"time, of day",u,y\n', '"time, of day",u,y', ",,", {}),
        (' "time" , u,y\n', "time,u,y", ",,", {}),
        ("9\n", ",,", ",,", {}),  # how many rows follow
        ("time,u\n", ",,", ",,", {"time": "u"}),  # a name is missing: none is believed
    ],
)  # fmt: skip
def test_lines_above_the_numbers(above: str, columns: str, units: str, said: dict[str, str]) -> None:
    found = sniff("log", (above + ROWS).encode(), True)
    names = ("time, of day", "u", "y") if columns.startswith('"') else tuple(columns.split(","))
    assert (found.columns, found.units, found.said) == (names, tuple(units.split(",")), said)
    assert found.first_line == 1 + above.count("\n")
    assert not found.ragged and found.stamps == ()


@pytest.mark.parametrize(
    ("text", "line"),
    [("time,u,y\n1,2\n", 2), ("time,u,y\n1,2,3,4\n", 2), ("time,u,y\n1,2\n3,4\n", 2), ("1,2\n", 1),
     ("time,u,y\n# 1,2\n", 3), ("time,u,y\nx,2\n", 3), ("time,u,y\n1,x,x,x\n", 3)],
)  # fmt: skip
def test_broken_rows_right_above_the_first_good_one_are_rows(text: str, line: int) -> None:
    assert sniff("log", (text + ROWS).encode(), True).first_line == line


@pytest.mark.parametrize("first", [3, 2])
def test_three_rows_of_numbers_above_are_another_table(first: int) -> None:
    above = "a,b\n" + "".join(f"{k},{k}\n" for k in range(first)) + "\ntime,u,y\n"
    if first == 2:
        assert sniff("log", (above + ROWS).encode(), True).columns == ("time", "u", "y")
    else:
        with pytest.raises(DataError, match="holds two tables, one from row 2 and another from row 7; save each"):
            sniff("log", (above + ROWS).encode(), True)
    mixed = above.replace("0,0", "0,x,x")  # a third of it is numbers
    assert sniff("log", (mixed + ROWS).encode(), True).columns == ("time", "u", "y")
    remarks = "".join(f"# {k},{k}\n" for k in range(5)) + "time,u,y\n"
    assert sniff("log", (remarks + ROWS).encode(), True).columns == ("time", "u", "y")


@pytest.mark.parametrize(
    ("header", "columns"), [("time,u,y,", "time,u,y"), ("time,u,y,note", "time,u,y"), ("time,u,y", "time,u,y")]
)
def test_rows_that_end_with_a_delimiter(header: str, columns: str) -> None:
    rows = ROWS.replace("\n", ",\n")
    found = sniff("log", f"{header}\n{rows}".encode(), True)
    assert found.ragged and found.columns == tuple(columns.split(","))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time,u,y\n", "has a header but no rows; record the log again"),
        ("time,u,y", "has a header but no rows"),
        ("time,u,y\nnothing,at,all\nin,these,rows\n", "holds no rows of numbers|has a header"),
        ("just words\nand more\n", "holds no rows of numbers; a log is a table"),
        ("  \n\n", "is empty; record the log again"),
        ("", "is empty"),
    ],
)
def test_texts_without_numbers(text: str, sentence: str) -> None:
    with pytest.raises(DataError, match=sentence):
        sniff("log", text.encode(), True)


@pytest.mark.parametrize(
    ("text", "marks", "columns"),
    [
        ("y\n1\n2\n3\n", Marks(None, ".", ""), ("y",)),
        ("time y\n0 1\n1 2\n", Marks(None, ".", ""), ("time", "y")),
        ("time;y\n0,5;1,5\n1,5;2\n", Marks(";", ",", ""), ("time", "y")),
        ("t,u\n1.234,5\n2.345,6\n", Marks(",", ".", ""), ("t", "u")),
        ("t;u\n1.234,5;5\n2.345,6;6\n", Marks(";", ",", "."), ("t", "u")),
        ("t;u\n1,234.5;5\n2,345.6;6\n", Marks(";", ".", ","), ("t", "u")),
        ("t;u\n1'234.5;5\n2'345.6;6\n", Marks(";", ".", "'"), ("t", "u")),
        ("t;u\n1 234,5;5\n2 345,6;6\n", Marks(";", ",", " "), ("t", "u")),
        ("t\tu|x\n1\t2\n2\t3\n", Marks("\t", ".", ""), ("t", "u|x")),
        ('t,u\n"1,5","2,5"\n"2,5","3,5"\n', Marks(",", ",", ""), ("t", "u")),
    ],
)  # fmt: skip
def test_marks(text: str, marks: Marks, columns: tuple[str, ...]) -> None:
    found = sniff("log", text.encode(), True)
    assert (found.marks, found.columns) == (marks, columns)


def test_a_last_line_that_may_be_cut_off_is_not_judged() -> None:
    """Of a long log only the first bytes are seen; a row cut in a number is a row of another kind."""
    assert sniff("log", b"time,y\n0,1\n1,", False).first_line == 2
    with pytest.raises(DataError, match="no rows"):
        sniff("log", b"time,y\n0,1", False)
    assert sniff("log", b"time,y\n0,1", True).first_line == 2


def test_stamps_are_found_by_the_first_row() -> None:
    text = "t,day,y\n10:00:00,2024-01-01 10:00:00,1\n10:00:01,2024-01-01 10:00:01,2\n"
    assert sniff("log", text.encode(), True).stamps == (0, 1)


@pytest.mark.parametrize(
    ("head", "encoding"),
    [
        (b"", "utf-8"), (b"a,b", "utf-8"), (b"\xef\xbb\xbfa", "utf-8-sig"), (b"\xff\xfea\0", "utf-16"),
        (b"\xfe\xff\0a", "utf-16"), ("abc,1\n".encode("utf-16-le"), "utf-16-le"),
        ("abc,1\n".encode("utf-16-be"), "utf-16-be"), (b"\0\1\2\3\4\5\6\7", ""), (b"Zeit \xb5s;a\n", "cp1252"),
        (b"abc\xc2", "utf-8"), (b"abc\xe2\x82", "utf-8"), (b"abc\xb5abcd", "cp1252"),
        (b"a" * 5000 + b"\0", "utf-8"),  # beyond the first 4 KiB
        ("µabc".encode("utf-16-le") + b"\x01\x02" * 2, "utf-16-le"),
    ],
)  # fmt: skip
def test_encodings_by_their_first_bytes(head: bytes, encoding: str) -> None:
    assert encoding_of(head) == encoding


def test_lines_whatever_ends_them() -> None:
    for end in ("\n", "\r\n", "\r"):
        for encoding in ("utf-8", "utf-16", "utf-16-le", "cp1252"):
            assert lines_of(f"a,b{end}1,2{end}".encode(encoding)) == ["a,b", "1,2", ""]
    assert lines_of("a,b\n1".encode("utf-16-le") + b"2") == ["a,b", "1"]  # cut inside a letter
    assert lines_of(b"\0\1\2\3\4\5\6\7") == []


def test_a_table_among_prose() -> None:
    assert has_table(["a note", "", *ROWS.splitlines()[:3]])
    assert not has_table(["a note", *ROWS.splitlines()[:2], "and words", *ROWS.splitlines()[2:]])
    assert not has_table(["words only", "and more"])
    assert not has_table([])


ODD = sniff("log", b"time,y\n0,1\n1,2\n2,3\n", True)


def test_every_bad_cell_is_told_with_its_place() -> None:
    body = memoryview(b"0,1\n# rest\n\n1,x\n2\n3,4,5\n4, nan \n5,6")
    assert by_arrow(body, ODD, (0, 1), 10) is None
    cells = cell_by_cell(body, ODD, (0, 1), 10)
    assert cells.bad == (BadCell(1, 1, "x"), BadCell(2, -1, "1"), BadCell(3, -1, "3"), BadCell(4, 1, "nan"))
    assert [cells.row(k) for k in range(6)] == [10, 13, 14, 15, 16, 17]
    np.testing.assert_array_equal(cells.values[0], [0, 1, np.nan, np.nan, 4, 5])
    np.testing.assert_array_equal(cells.values[1], [1, np.nan, np.nan, np.nan, np.nan, 6])
    assert cell_by_cell(memoryview(b"0," + b"x" * 50), ODD, (1,), 1).bad == (BadCell(0, 1, "x" * 40),)


def test_both_ways_of_reading_count_lines_alike() -> None:
    body = memoryview(b"0,1\n1,2.5\n2,4")
    quick, slow = by_arrow(body, ODD, (1, 0), 7), cell_by_cell(body, ODD, (1, 0), 7)
    assert quick is not None
    for one in (quick, slow):
        assert [values.tolist() for values in one.values] == [[1, 2.5, 4], [0, 1, 2]]
        assert [one.row(k) for k in range(3)] == [7, 8, 9]
    for words in (b"0,inf", b"0,1\n,2", b"0,1\n\n1,2", b"0,1,2"):
        assert by_arrow(memoryview(words), ODD, (0, 1), 1) is None


@pytest.mark.parametrize(
    ("digits", "whole"), [("123456789012345", False), ("1234567890123456", True), ("1700000000000000001", True)]
)
def test_whole_numbers_of_more_than_15_digits_stay_whole(digits: str, whole: bool) -> None:
    cells = by_arrow(memoryview(f"{digits},1\n{digits},2".encode()), ODD, (0, 1), 1)
    assert cells is not None
    assert (cells.values[0].dtype == np.int64) is whole and int(cells.values[0][0]) == int(digits)
    assert cells.values[1].dtype == np.float64


def test_pieces_of_whole_lines(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the blocks are that are read, the pieces are whole lines and nothing is lost."""
    from dataclasses import replace

    for end in (b"\n", b"\r\n", b"\r"):
        text = end.join([b"time,y", b"0,1", b"10,2", b"", b"200,3", b"4,5"])
        for last in (b"", end, end * 2):
            (tmp_path / "a").write_bytes(text + last)
            for size in range(1, 40):
                monkeypatch.setattr("eaid.logs.text.PIECE_BYTES", size if size > len(b"time,y" + end) else 40)
                with (tmp_path / "a").open("rb") as file:
                    pieces = [bytes(piece) for piece in _pieces(file, replace(ODD, first_line=2))]
                assert b"".join(pieces) == (text + last)[len(b"time,y" + end) :]
                assert all(piece.endswith((b"\n", b"\r")) for piece in pieces[:-1])
                assert sum(map(_lines, map(memoryview, pieces))) == _lines(memoryview(text + last)) - 1


def test_line_ends_and_blanks() -> None:
    counted = {b"": 0, b"a": 0, b"a\n": 1, b"a\r\nb\r\n": 2, b"a\rb\r": 2, b"a\r\nb\rc\n": 3}
    assert {text: _lines(memoryview(text)) for text in counted} == counted
    assert bytes(_stripped(memoryview(b"1,2\r\n \t\0\x1a"))) == b"1,2"
    assert bytes(_stripped(memoryview(b"  \n"))) == b""


def test_days() -> None:
    same = ("2024-03-01", "2024/03/01", "2024.03.01", "01.03.2024", "01/03/2024", "1-3-2024")
    assert {_day(text) for text in same} == {738946}
    assert _day("03/13/2024") == 738946 + 12 and _day("13/03/2024") == 738946 + 12
    assert _day("2024-02-30") is None and _day("monday") is None


@pytest.mark.parametrize(
    ("line", "count", "cells"),
    [("1,2,3", 0, 3), ("1,2,", 0, 2), ("1,2,", 2, 2), ("1,2,", 3, 3), ("1,2, ,", 3, 3), (",", 0, 1),
     ('"1,2",3', 0, 2), ('"1', 0, 1), ("1,2\r\n", 0, 2)],
)  # fmt: skip
def test_cells_of_a_line(line: str, count: int, cells: int) -> None:
    assert len(Marks(",", ".", "").cells(line, count)) == cells


def test_what_is_a_stamp_and_what_a_good_cell() -> None:
    marks = Marks(";", ".", "")
    stamps = (
        "10:00",
        "1:00:00.5",
        "2024-01-02 10:00:00",
        '"10:00:00"',
        "10:00:00 PM",
        "1/2/2024T10:00Z",
        "10:00:00+02:00",
    )
    assert all(marks.is_stamp(one) for one in stamps)
    assert not any(marks.is_stamp(one) for one in ("10", "10.5", "x", "", "2024-01-02", "100:00", "10:0"))
    assert marks.count_good(["1", "x", "", "10:00", "nan"]) == (3, 4)
    assert marks.value("1e3") == 1000.0 and math.isnan(marks.value("nan") or 0.0) and marks.value("x") is None


@pytest.mark.parametrize(("first", "later"), [("1.5", "1,5"), ("1,5", "1.5")])
def test_as_many_bad_cells_either_way_leave_the_decimal_point(first: str, later: str, tmp_path) -> None:
    cells = [first, *"2345", later, *"789"]
    (tmp_path / "a.csv").write_text("time;duty;y\n" + "".join(f"{k};{k % 3};{one}\n" for k, one in enumerate(cells)))
    with pytest.raises(DataError) as fault:
        read_runs([tmp_path / "a.csv"])
    (said,) = fault.value.sentences
    assert "column y, holds '1,5', which is no number" in said


def test_marks_that_only_later_rows_show(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole numbers at first, decimal commas beyond the first bytes."""
    monkeypatch.setattr("eaid.logs.text.HEAD_BYTES", 60)
    cells = [*map(str, range(1, 12)), "12,5", "13,25"]
    (tmp_path / "a.csv").write_text("time;duty;y\n" + "".join(f"{k};{k % 3};{one}\n" for k, one in enumerate(cells)))
    (run,) = read_runs([tmp_path / "a.csv"])
    assert run.output.tolist() == [*range(1, 12), 12.5, 13.25]


def test_a_list_of_settings_above_a_shorter_table_does_not_say_its_marks() -> None:
    settings = "".join(f"k{k};{k}\n" for k in range(120))
    table = "".join(f"{k},{k % 3},{k}\n" for k in range(50))
    found = sniff("log", f"{settings}time,duty,torque\n{table}".encode(), True)
    assert (found.marks.delimiter, found.columns, found.first_line) == (",", ("time", "duty", "torque"), 122)
