"""The sentences about logs: every code of the table is used, and says what it means in plain words."""

from pathlib import Path

import pytest

import eaid.logs
from eaid.findings import finding, say
from eaid.findings.sentences.logs import LOG_ROWS

SAID = {
    "step-row-dropped": (
        {"row": 202, "at_s": 1.0},
        "«repair» dropped row 202, at which the input changes (1 s): the step counts from the next row; "
        "say «step_at» 1 if it began there",
    ),
    "rows-dropped": ({"dropped": 2, "count": 300}, "«repair» dropped 2 of 300 rows"),
    "columns-by-place": ({"order": "time, output"}, "its columns have no names: taken as time, output"),
    "columns-without-numbers": ({"columns": "note"}, "note hold no real numbers and are left out"),
    "signals-held": (
        {"columns": "Duty", "left_out": 2},
        "Duty recorded at other times than the output: held between samples; 2 samples before the first left out",
    ),
    "time-too-long": (
        {"column": "t", "usual_s": 5000.0, "span_s": 4e6, "likely": "us"},
        "no unit is given for t, whole numbers 5000 apart: in seconds the log would take 4e+06 s; say it with «units» "
        "time=us or time=s",
    ),
    "log-given-twice": (
        {"path": "b.csv", "first": "a.csv"}, "b.csv is the same log as a.csv (equal SHA-256): it counts once",
    ),
    "input-in-fractions": (
        {"other": 90.0},
        "its input stays within 1 while that of other logs goes to 90 %: a fraction is read apart with «units» "
        "input=fraction; if all are in %, say «units» input=%",
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", SAID)
def test_words(code: str) -> None:
    values, wanted = SAID[code]
    assert say(finding(code, "a", **values)) == wanted  # type: ignore[arg-type]


def test_every_code_is_used_and_every_code_used_stands_in_the_table() -> None:
    folder = Path(str(eaid.logs.__file__)).parent
    text = "".join(path.read_text(encoding="utf-8") for path in folder.rglob("*.py"))
    assert [code for code in LOG_ROWS if f'"{code}"' not in text] == []
