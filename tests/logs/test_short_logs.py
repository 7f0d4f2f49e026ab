"""Text logs of hardly any rows: the last row counts, with and without a line break behind it."""

import pytest

import eaid


@pytest.mark.parametrize("end", ["", "\n"])
@pytest.mark.parametrize("rows", [1, 2, 3])
def test_the_last_row_of_a_short_log_is_read(tmp_path, rows, end):
    lines = ["time_s,duty_pct,torque_nm", *(f"{k},{50 * (k > 0)},{k}" for k in range(rows))]
    (tmp_path / "a.csv").write_text("\n".join(lines) + end)
    (log,) = eaid.read(tmp_path / "a.csv").recorded
    assert log.output.tolist() == [float(k) for k in range(rows)]
