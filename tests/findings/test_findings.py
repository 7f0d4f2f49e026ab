"""Findings are data: severity from the table, merged by code, said last."""

import string

import pytest

from eaid.errors import DataError, in_python, on_command_line
from eaid.findings import Finding, finding, merged, ranked, say, stops
from eaid.findings.finding import listed
from eaid.findings.row import Row
from eaid.findings.sentences import SENTENCES


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SENTENCES, "test-a", Row("caution", "at {levels}: {rmse:.2g} V, see «step_at»", size="rmse"))
    monkeypatch.setitem(SENTENCES, "test-b", Row("stop", lambda v: f"{v['subject']}: no"))


@pytest.mark.usefixtures("rows")
def test_the_table_gives_severity_and_sentence():
    one = finding("test-a", "friction", levels=(10, 20, 30.5), rmse=0.123)
    assert one == Finding("test-a", "caution", "friction", (10.0, 20.0, 30.5), {"rmse": 0.123})
    assert in_python(say(one)) == "at 10, 20 and 30.5: 0.12 V, see step_at="
    assert on_command_line(say(one)) == "at 10, 20 and 30.5: 0.12 V, see --step-at"
    assert say(finding("test-b", "linear")) == "linear: no"


@pytest.mark.usefixtures("rows")
def test_the_worst_of_a_code_stands_for_all():
    runs = [finding("test-a", f"run {i}", rmse=size) for i, size in enumerate((0.1, -0.9, 0.3))]
    (one,) = merged(runs)
    assert (one.subject, one.values["others"]) == ("run 1", 2)
    assert say(one).endswith("(and 2 more)")


@pytest.mark.usefixtures("rows")
def test_the_gravest_come_first_and_stops_are_found():
    found = [finding("test-a", "x", rmse=1.0), finding("test-b", "y"), finding("test-a", "z", rmse=2.0)]
    assert [one.subject for one in ranked(found)] == ["y", "x", "z"]
    assert [one.subject for one in stops(found)] == ["y"]


def test_a_code_without_a_row_is_a_bug_where_it_is_made_and_is_said_as_it_is_where_it_is_read():
    with pytest.raises(KeyError):
        finding("no-such-code", "x")
    assert say(Finding("from-a-later-version", "note", "x")) == "from-a-later-version"


def test_errors_name_options_as_the_reader_writes_them():
    assert str(DataError("give «step_at»")) == "give step_at="
    assert on_command_line(DataError("give «step_at»").sentences[0]) == "give --step-at"


@pytest.mark.parametrize("code", list(SENTENCES))
def test_every_row_is_well_formed(code: str):
    row = SENTENCES[code]
    assert code == code.lower()
    assert " " not in code
    assert row.severity in ("stop", "caution", "note")
    if isinstance(row.template, str):
        assert "--" not in row.template
        assert all(name is None or name.isidentifier() for _, name, _, _ in string.Formatter().parse(row.template))


def test_listed():
    assert [listed(x) for x in ((), (1.0,), (1.0, 2.5), ("a", "b", "c"))] == ["", "1", "1 and 2.5", "a, b and c"]
    assert listed([float(u) for u in range(10, 101, 10)]) == "10 … 100 (10 of them)"


def test_what_the_numbers_mean_is_told_first_and_what_it_covers_is_not_told_again():
    found = [
        finding("one-level-linear", "linear", levels=(50,)),
        finding("one-level-nonlinear", "nonlinear"),
        finding("shape-of-another-kind", "friction", shape="x", rmse=1.0, usual_rmse=2.0, usual="y"),
        finding("other-shape-fits-better", "run", (50,), shape="one", dead_time_s=15.0, rmse=0.3, plain_rmse=0.7),
    ]
    assert [one.code for one in ranked(merged(found))] == ["other-shape-fits-better", "one-level-nonlinear"]


@pytest.mark.parametrize("code", [code for code, row in SENTENCES.items() if row.covers])
def test_a_row_covers_codes_that_there_are(code: str):
    assert set(SENTENCES[code].covers) <= SENTENCES.keys()


@pytest.mark.parametrize(("runs", "said"), [(1, "in 1 run:"), (3, "in 3 runs:")])
def test_sentences_count(runs: int, said: str):
    assert said in say(finding("signs-turned", "data", runs=runs))


def test_a_unit_that_is_not_known_leaves_no_gap() -> None:
    said = say(finding("coarse-output", "run", (50.0,), resolution=60.0, unit="", steps=23.0))
    assert "of 60, 23 of them" in said and " ," not in said
