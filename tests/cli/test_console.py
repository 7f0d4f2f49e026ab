"""Tables on a terminal, findings, and texts that want to command it."""

import sys

import pytest

from eaid.cli import console
from eaid.cli.console import aligned
from eaid.findings import finding

ROWS = [
    ["level [%]", "T_s [N·m]", "τ1 [s]", "verdict"],
    ["10", "0.14443", "0.2268", "converged"],
    ["100", "4.4234", "0.28", "held: " + "word " * 20],
]


def test_numbers_stand_to_the_right_and_brackets_stay():
    assert aligned([["level [%]", "τ1 [s]"], ["10", "0.2"], ["100", "12.25"]]) == [
        "level [%]  τ1 [s]",
        "10            0.2",
        "100         12.25",
    ]


@pytest.mark.parametrize("width", [40, 60, 80])
def test_nothing_is_broken_mid_word_and_nothing_is_wider_than_the_terminal(width: int):
    lines = aligned(ROWS, width)
    assert max(len(one) for one in lines) <= width
    words = " ".join(lines).split()
    assert {"0.14443", "4.4234", "0.2268", "converged", "held:"} <= set(words)
    assert words.count("word") == 20


def test_columns_that_do_not_fit_follow_under_the_first_one():
    rows = [["run", *(f"column {i}" for i in range(6))], ["a-long-name-of-a-run", *("0.123456" for _ in range(6))]]
    lines = aligned(rows, 60)
    assert sum(one.startswith("a-long-name-of-a-run") for one in lines) > 1
    assert " ".join(lines).split().count("0.123456") == 6


@pytest.mark.parametrize(
    "evil", ["\x1b[31mred", "bell\a", "two\r\nerror: forged", "\u202eright to left", "\u2028line", "\ud800"]
)
def test_names_have_no_power_over_the_terminal(evil: str, capsys: pytest.CaptureFixture[str]):
    console.be_quiet(False)
    console.fail(evil)
    console.say(evil)
    console.table(evil, [evil], [[evil]])
    said = capsys.readouterr()
    assert said.err.count("\n") == 2
    assert said.out.count("\n") == 3
    assert evil not in said.err + said.out
    assert not {"\x1b", "\a", "\r", "\u202e", "\u2028"} & set(said.err + said.out)


def test_the_three_gravest_findings_come_first_and_the_rest_is_counted(capsys: pytest.CaptureFixture[str]):
    console.be_quiet(False)
    many = [finding("result-written-anew", "a.json"), finding("part-left-out", "b.json", part="linear", key="a0")]
    console.tell([*many, many[0]])
    told = capsys.readouterr().err.splitlines()
    assert told == [
        "warning: b.json: its linear has no a0 and is left out",
        "note: a.json: another program has written it anew: its digest no longer fits and is passed over (and 1 more)",
    ]


def test_rows_that_were_dropped_are_told_however_much_else_there_is(capsys: pytest.CaptureFixture[str]):
    console.be_quiet(False)
    grave = [finding(code, "x", part="p", key="k") for code in ("part-left-out",)]
    others = [finding("input-by-its-steps", "x", column="a", still="b"), finding("columns-by-place", "x", order="t, u")]
    repaired = finding("rows-dropped", "a.csv", dropped=14, count=100)
    console.tell([*grave, *others, repaired])
    assert "warning: --repair dropped 14 of 100 rows" in capsys.readouterr().err.splitlines()


def test_colour_is_for_terminals_and_no_color_is_kept(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    console.warn("x")
    assert capsys.readouterr().err == "\x1b[33mwarning:\x1b[0m x\n"
    monkeypatch.setenv("NO_COLOR", "1")
    console.warn("x")
    assert capsys.readouterr().err == "warning: x\n"


def test_progress_without_a_terminal_is_told_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    clock = iter(range(0, 1000, 3))
    monkeypatch.setattr(console.time, "monotonic", lambda: next(clock))
    with console.progress("reading logs", 10) as advance:
        for _ in range(10):
            advance()
    told = capsys.readouterr().err.splitlines()
    assert told[0] == "reading logs: 10 to do"
    assert 2 <= len(told) <= 6
