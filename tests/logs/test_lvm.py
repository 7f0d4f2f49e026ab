"""LabVIEW measurement files: header, segments, decimal comma, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError
from eaid.logs.foreign.lvm import read_lvm
from eaid.logs.read import read_runs

REAL = Path(__file__).parents[2] / "../shared/realdata/formats"
END = "***End_of_Header***"


def lvm(segments, own="One", decimal=".", separator="\t", multi="No"):
    """Text of a file; each segment: (header lines, names, rows of cells)."""
    word = {"\t": "Tab", ",": "Comma"}[separator]
    top = ["LabVIEW Measurement", "Writer_Version|2", f"Separator|{word}", f"Decimal_Separator|{decimal}",
           f"Multi_Headings|{multi}", f"X_Columns|{own}", END, ""]  # fmt: skip
    for header, names, rows in segments:
        top += [*header, END, names, *rows]
    return "\n".join(top).replace("|", separator) + "\n"


def read(path, text, columns=None, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    (sheet,) = read_lvm(path, "log.lvm")
    return sheet, sheet.load(range(len(sheet.columns)) if columns is None else columns)


HEAD = ["Channels|2", "Samples|3|3", "Y_Unit_Label|%|Nm", "X_Dimension|Time|Time", "X0|0.5|0.5", "Delta_X|0.25|0.25"]


def test_a_column_of_times(tmp_path):
    sheet, cells = read(
        tmp_path / "a",
        lvm([(HEAD, "X_Value|Duty|Torque|Comment", ["0.5|0|1e-3", "0.75|50|2|hello", "1|50|3"])]),
    )
    assert sheet.columns == ("time", "Duty", "Torque")
    assert sheet.units == ("s", "%", "Nm")
    time, duty, torque = cells.values
    assert time.tolist() == [0.5, 0.75, 1.0]
    assert duty.tolist() == [0, 50, 50]
    assert torque.tolist() == [1e-3, 2, 3]


def test_without_a_column_of_times_and_with_decimal_comma(tmp_path):
    text = lvm([(HEAD, "X_Value|Duty|Torque|Comment", ["|0|0.1", "|50|2", "|50|3"])], own="No").replace(".", ",")
    _, cells = read(tmp_path / "a", text)
    assert cells.values[0].tolist() == [0.5, 0.75, 1.0]
    assert cells.values[2].tolist() == [0.1, 2, 3]


def test_columns_come_in_the_order_asked_for(tmp_path):
    _, cells = read(tmp_path / "a", lvm([(HEAD, "X_Value|Duty|Torque|Comment", ["0|1|2", "1|3|4"])]), columns=[2, 0])
    assert [v.tolist() for v in cells.values] == [[2, 4], [0, 1]]


def test_a_time_of_its_own_for_each_channel(tmp_path):
    names = "X_Value|Duty|X_Value|Torque|Comment"
    sheet, cells = read(tmp_path / "a", lvm([(HEAD, names, ["0|1|0|2", "1|3|1|4"])], own="Multi"))
    assert sheet.columns == ("time", "Duty", "Torque")
    assert [v.tolist() for v in cells.values] == [[0, 1], [1, 3], [2, 4]]
    with pytest.raises(DataError, match="its channels have different times; export them on one X column"):
        read(tmp_path / "a", lvm([(HEAD, names, ["0|1|0|2", "1|3|1.5|4"])], own="Multi"))


def test_segments_that_start_anew_are_put_apart_by_the_clock(tmp_path):
    def head(clock):
        return [*HEAD, "Date|2024/10/29|2024/10/29", f"Time|{clock}|{clock}"]

    names = "X_Value|Duty|Torque|Comment"
    text = lvm(
        [(head("23:59:59.5"), names, ["|0|1", "|0|2"]), (head("23:59:60"), names, ["|0|1"])], own="No", multi="Yes"
    )
    assert read(tmp_path / "a", text)[1].values[0].tolist() == [0.5, 0.75, 0.5]  # 23:59:60 is no time: left as it is
    text = lvm(
        [(head("09:51:40.25"), names, ["|0|1", "|0|2"]), (head("09:51:41"), names, ["|0|3"])], own="No", multi="Yes"
    )
    _, cells = read(tmp_path / "a", text)
    assert cells.values[0].tolist() == [0.5, 0.75, 1.25]
    assert cells.values[2].tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("LabVIEW Measurement\nSeparator\tTab\n1\t2\n", r"its header has no end \(\*\*\*End_of_Header\*\*\*\)"),
        (lvm([]), "its header cannot be followed"),
        (lvm([(HEAD, "Duty|Torque", ["0|1"])]), "its header cannot be followed"),
        (lvm([(HEAD, "X_Value|Comment", ["0"])]), "names no channels; record the log again"),
        (lvm([(["Channels|1", "X_Dimension|Frequency"], "X_Value|A", ["0|1"])]), "its X is Frequency, not Time"),
        (lvm([(["Channels|1", "X0|0"], "X_Value|A", ["|1"])], own="No"), "neither a column of times nor a Delta_X"),
        (lvm([(["Channels|1", "Delta_X|fast"], "X_Value|A", ["0|1"])], own="No"), "its header cannot be followed"),
        (lvm([(HEAD, "X_Value|A", ["0|1"])], own="Two"), "its X_Columns is 'Two', not No, One or Multi"),
        (lvm([(HEAD, "X_Value|A", ["0|1"]), (["Channels|1", *HEAD[1:]], "X_Value|B", ["0|1"])]),
         r"its channels change \(B, before: A\); split the file there"),
    ],
)  # fmt: skip
def test_what_cannot_be_followed_is_refused(tmp_path, text, sentence):
    with pytest.raises(DataError, match=sentence):
        read(tmp_path / "a", text)


def test_bad_cells_are_told_by_row_and_column(tmp_path):
    rows = [f"{i / 100}|{50 * (i > 20)}|{i}" for i in range(60)]
    rows[30] = "0.3|50|x"
    path = tmp_path / "a.lvm"
    path.write_text(lvm([(HEAD, "X_Value|Duty|Torque|Comment", rows)]))
    with pytest.raises(DataError) as caught:
        read_runs([path])
    told = "\n".join(caught.value.sentences)
    assert "row 47, column Torque, holds 'x', which is no number" in told


ODD_ROWS = {
    "a word": ("0.3|50|x", "row 47, column Torque, holds 'x', which is no number"),
    "no time": ("|50|1", "row 47, column time, is empty"),
    "too short": ("0.3|50", "row 47 has 2 cells, unlike the others"),
    "separators only": ("||", "row 47, column time, is empty"),
    "a mark": (END, "row 47 has 1 cells, unlike the others"),
    "a block that does not end": ("***Start_Special***", "row 47 begins a special block that does not end"),
    "half a header": ("Channels|2", "its header cannot be followed"),
}


@pytest.mark.parametrize("odd", ODD_ROWS)
def test_no_row_is_lost_in_silence(tmp_path, odd):
    rows = [f"{i / 100}|{50 * (i > 20)}|{i}" for i in range(60)]
    rows[30], sentence = ODD_ROWS[odd]
    path = tmp_path / "a.lvm"
    path.write_text(lvm([(HEAD, "X_Value|Duty|Torque|Comment", rows)]))
    with pytest.raises(DataError) as caught:
        read_runs([path])
    assert sentence in "\n".join(caught.value.sentences)


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded logs are not here")
@pytest.mark.parametrize(
    ("name", "output", "first", "count", "unit"),
    [
        ("lvm_decimal_comma_no_x_column__short.lvm", "Response (Trigger)", 1.204792, 10, "m/s^2"),
        ("lvm_x_column_irregular_comments_latin1__with_comments.lvm", "Pressão ABS. (MPa)", 1.833787, 9, "bar"),
    ],
)
def test_recorded_files(name, output, first, count, unit):
    options = ReadOptions(columns={"output": output})
    (run,) = read_runs([REAL / name], options)
    assert len(run.time_s) == count
    assert run.output_unit == unit
    np.testing.assert_allclose(run.output[0], first * (10 if unit == "bar" else 1), rtol=1e-15)
