"""Tables on a terminal."""

import sys

from eaid.cli import console


def test_a_narrow_terminal_cuts_no_name_off(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    console.be_quiet(False)
    console.table("200 plants", ["metric", "median"], [["steps[7].settling_5pct_s", "0.01234"]])
    rows = [row[1:-1].split("│") for row in capsys.readouterr().out.splitlines() if row.startswith("│")]
    assert ["".join(cell.strip() for cell in column) for column in zip(*rows, strict=True)] == [
        "steps[7].settling_5pct_s",
        "0.01234",
    ]
