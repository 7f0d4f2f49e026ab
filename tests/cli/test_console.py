"""What is printed: tables and messages on a terminal and elsewhere, findings, names that want to command it."""

import os
import sys
import time

import pytest

from eaid.cli import console
from eaid.findings import finding
from eaid.report.tables import Column, Table

HEADS = ["level [%]", "T_s [N·m]", "τ1 [s]", "verdict"]
ROWS = (("10", "0.14443", "0.2268", "converged"), ("100", "4.4234", "0.28", "held: " + "word " * 20))


@pytest.fixture
def terminal(monkeypatch):
    """Both streams are a terminal of that width."""

    def of(width):
        for stream in (sys.stdout, sys.stderr):
            monkeypatch.setattr(stream, "isatty", lambda: True)
        monkeypatch.setenv("COLUMNS", str(width))
        monkeypatch.setattr(os, "get_terminal_size", lambda *_: os.terminal_size((width, 50)))

    return of


@pytest.mark.parametrize("width", [40, 80])
def test_nothing_is_broken_mid_word_and_nothing_is_wider_than_the_terminal(width, terminal, capsys):
    terminal(width)
    title = "A title of some words, which is longer than forty letters are"
    console.show(Table(title, "", tuple(map(Column, HEADS)), ROWS))
    console.speak("word " * 30)
    told = capsys.readouterr()
    assert max(map(len, (told.out + told.err).splitlines())) <= width
    words = told.out.split()
    assert {"0.14443", "4.4234", "0.2268", "converged", "held:"} <= set(words)
    assert words.count("word") == 20 and told.err.split().count("word") == 30


@pytest.mark.parametrize(
    "evil", ["\x1b[31mred", "bell\a", "two\r\nerror: forged", "\u202eright to left", "\u2028line", "\ud800"]
)
def test_names_have_no_power_over_the_terminal(evil, capsys):
    console.fail(evil)
    console.speak(evil)
    console.show(Table(evil, "", (Column(evil),), ((evil,),)))
    told = capsys.readouterr()
    assert told.err.count("\n") == 2 and told.out.count("\n") == 3
    assert evil not in told.err + told.out
    assert not {"\x1b", "\a", "\r", "\u202e", "\u2028"} & set(told.err + told.out)


def test_the_three_gravest_findings_come_first_and_rows_that_were_dropped_are_always_told(capsys):
    left_out = finding("part-left-out", "b.json", part="linear", key="a0")
    anew = finding("result-written-anew", "a.json")
    console.tell([anew, left_out, anew])
    assert capsys.readouterr().err.splitlines() == [
        "warning: b.json: its linear has no a0 and is left out",
        "note: a.json: another program has written it anew: its digest no longer fits and is passed over (and 1 more)",
    ]
    contradicted = finding("level-contradicted", "x", level=1.0, found=2.0, unit="V")
    others = [contradicted, finding("columns-by-place", "x", order="t, u"), anew]
    many = [left_out, *others, finding("rows-dropped", "a.csv", dropped=14, count=100)]
    console.tell(many)
    told = capsys.readouterr().err.splitlines()
    assert "warning: --repair dropped 14 of 100 rows" in told and "and 1 more: --verbose shows all" in told
    console.tell(many, verbose=True)
    assert len(capsys.readouterr().err.splitlines()) == 5
    with console.hushed(True):
        console.tell(many, verbose=True)
    assert capsys.readouterr().err == ""


def test_colour_is_for_terminals_and_no_color_is_kept(terminal, monkeypatch, capsys):
    console.warn("x")
    assert capsys.readouterr().err == "warning: x\n"
    terminal(80)
    console.warn("x")
    console.fail("y")
    assert capsys.readouterr().err == "\x1b[33mwarning:\x1b[0m x\n\x1b[1;31merror:\x1b[0m y\n"
    monkeypatch.setenv("NO_COLOR", "1")
    console.warn("x")
    assert capsys.readouterr().err == "warning: x\n"


def test_progress_is_a_bar_on_a_terminal_and_now_and_then_a_line_elsewhere(terminal, monkeypatch, capsys):
    def reading(pieces):
        with console.progress("reading logs", pieces) as advance:
            for _ in range(pieces):
                advance()
        return capsys.readouterr().err

    monkeypatch.setattr(console, "EVERY_S", 0.01)
    for total, first, later in ((10, ["reading logs: 10 to do"], "1 of 10"), (0, [], "1 done, 0 s")):
        with console.progress("reading logs", total) as advance:
            advance()
            time.sleep(0.2)  # one long piece is told of, too
        told = capsys.readouterr().err.splitlines()
        assert told[: len(first)] == first and f"reading logs: {later}" in told
    assert reading(1) == ""
    monkeypatch.undo()
    terminal(80)
    assert "10/10" in reading(10)
    with console.hushed(True):
        assert reading(10) == ""


def test_a_letter_with_a_hat_is_as_wide_as_one_without():
    """`B̂ 0.0019, φ 343` was broken in a pipe, where nothing is."""
    assert len(console.aligned([("gains",), ("K_P 74.6, B̂ 0.0019, φ 343",)], [False], None)) == 2
