"""Findings are data: severity from the table, merged by code, said last."""

import string

import pytest

from eaid import errors, findings
from eaid.findings.sentences import SENTENCES


def made(code, subject="run", **values):
    return findings.finding(code, subject, **values)  # type: ignore[arg-type]


def test_the_table_gives_severity_and_sentence():
    one = findings.finding("unsettled-before-step", "a", levels=(20, 30.5), share_pct=12.3)
    assert one == findings.Finding("unsettled-before-step", "stop", "a", (20.0, 30.5), {"share_pct": 12.3})
    assert "from 20 and 30.5, by 12 % of" in findings.say(one)
    many = findings.finding("unsettled-before-step", "a", levels=range(10, 101, 10), share_pct=12.3)
    assert "from 10 … 100 (10 of them), by" in findings.say(many)
    late = made("step-in-gap", gap_s=0.5, at_s=1.0, moved_pct=20.0)
    assert "with step_at=" in errors.in_python(findings.say(late))
    assert "with --step-at" in errors.on_command_line(findings.say(late))
    said = "say «units» time=ms,output=N; «share» 0.78, or «until» 5, no «repair» drops; «name_pattern» 'V={level}'"
    assert errors.in_python(said) == (
        "say units=\"time=ms,output=N\"; share=0.78, or until=5, no repair= drops; name_pattern='V={level}'"
    )


def test_the_worst_of_a_code_stands_for_all():
    gaps = [made("gap", f"run {k}", gap_s=size, at_s=0.0, sample_s=0.01) for k, size in enumerate((0.1, -0.9, 0.3))]
    (one,) = findings.merged(gaps)
    assert (one.subject, one.values["others"]) == ("run 1", 2)
    assert findings.say(one).endswith("(and 2 more)")


def test_the_gravest_come_first_and_what_the_numbers_mean_before_what_follows_from_it():
    found = [
        made("input-negative", "x"), made("gap", "y", gap_s=1.0, at_s=0.0, sample_s=0.01),
        made("spikes", "z", samples=1, value=1.0, unit="V", at_s=0.0),
        made("level-to-level", "run", steps=1, of=2), made("idle-drifts", "run", drift=0.2, unit="V"),
    ]  # fmt: skip
    codes = [one.code for one in findings.ranked(found)]
    assert codes == ["spikes", "idle-drifts", "gap", "input-negative", "level-to-level"]
    assert [one.code for one in findings.stops(found)] == ["spikes"]


def test_what_a_finding_covers_is_not_told_beside_it():
    found = [
        findings.finding("one-level-linear", "linear", levels=(50,)),
        made("one-level-nonlinear", "nonlinear"),
        made("other-shape-fits-better", shape="one", dead_time_s=15.0, rmse=0.3, plain_rmse=0.7),
    ]
    codes = [one.code for one in findings.ranked(findings.merged(found))]
    assert codes == ["other-shape-fits-better", "one-level-nonlinear"]


def test_a_code_without_a_row_is_a_bug_where_it_is_made_and_is_said_as_it_is_where_it_is_read():
    with pytest.raises(KeyError):
        made("no-such-code")
    assert findings.say(findings.Finding("from-a-later-version", "note", "x")) == "from-a-later-version"


@pytest.mark.parametrize("code", SENTENCES)
def test_every_row_is_well_formed(code):
    row = SENTENCES[code]
    assert code == code.lower() and " " not in code and row.severity in ("stop", "caution", "note")
    assert set(row.covers) <= SENTENCES.keys()
    if isinstance(row.template, str):
        assert "--" not in row.template
        assert all(name is None or name.isidentifier() for _, name, _, _ in string.Formatter().parse(row.template))


SAID = {
    "signs-turned ": ({"runs": 3}, "in 3 runs: the fit counts it upwards"),
    "coarse-output": ({"resolution": 60.0, "unit": "", "steps": 23.0}, "in steps of 60, 23 of them"),
    "other-shape-fits-better": (
        {"shape": "one", "dead_time_s": 15.6, "rmse": 0.27, "plain_rmse": 0.72},
        "asks for one exponential behind a dead time of 15.6 s: RMSE 0.27 instead of 0.72"),
    "release-alike": ({"edges_s": (0.1, 0.2), "chance": float("nan")}, "(chance unknown)"),
    "idle-drifts": ({"drift": 0.2, "unit": "N", "share_pct": 10.0}, "+0.2 N while idle (10 % of the step)"),
}  # fmt: skip


@pytest.mark.parametrize("case", SAID)
def test_sentences_that_count_list_or_leave_out(case):
    values, said = SAID[case]
    assert said in findings.say(made(case.strip(), **values))


def test_no_share_is_advised_where_a_slow_part_outlasts_its_record():
    """Held friction of 16.9 N became T_s 24.6 ± 6 % by following "next eaid fit … --share 0.636"."""
    asks = made("runs-reject-the-share", "friction", held=0.85, estimate=0.636, low=0.6, high=0.67)
    beyond = made("tau2-outlasts-record", "friction", levels=(5.0,), record_s=2.78, unit="bar")
    assert findings.advised([asks], ()) == ("", "--share 0.636")
    assert findings.advised([asks, beyond], ()) == ("", "")
