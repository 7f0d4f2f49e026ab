"""The face of `eaid`: help, version, and what a failure looks like."""

import re
import signal
from functools import partial

import pytest

import eaid
from eaid import DataError, GainsError, UsageError
from eaid.cli import main

COMMANDS = [
    "ingest", "fit", "tune-rc", "simulate", "export", "report", "synth", "couple", "compare", "sessions", "today",
    "plan", "demo",
]  # fmt: skip
SEEDED = {"fit", "tune-rc", "simulate", "synth", "plan", "compare"}


def test_version(run_eaid):
    ran = run_eaid("--version")
    assert (ran.code, ran.out, ran.err) == (0, f"eaid {eaid.__version__}\n", "")


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_bare_eaid_lists_its_commands_and_is_no_failure(words, run_eaid):
    ran = run_eaid(words)
    assert ran.code == 0 and re.findall(r"^  ([a-z][a-z-]+) ", ran.out, re.M) == COMMANDS


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_the_options_of_all_commands_and_one_example(name, run_eaid):
    ran = run_eaid(name, "--help")
    assert ran.code == 0 and f"Usage: eaid {name}" in ran.out and ran.out.count(f"Example: eaid {name}") == 1
    flags = set(re.findall(r"--[a-z][a-z-]*", ran.out))
    common = ["output", "json", "quiet", "verbose", "force", "help", *(["seed"] if name in SEEDED else [])]
    assert {f"--{one}" for one in common} <= flags
    assert max(map(ord, ran.out)) < 0x1F000  # in Markdown 20:100:20 is 20, a hundred-points sign, and 20


@pytest.mark.parametrize(
    ("fault", "code", "told"),
    [
        (UsageError("a.csv: no step", "b.csv: no torque"), 2, "error: a.csv: no step\nerror: b.csv: no torque\n"),
        (UsageError("x: give «force» or another «pi_gains»"), 2, "error: x: give --force or another --pi-gains\n"),
        (DataError("a.csv: no step"), 3, "error: a.csv: no step\n"), (GainsError("b0 is 0"), 5, "error: b0 is 0\n"),
        (KeyboardInterrupt(), 130, "error: interrupted; nothing half-written is left\n"),
        (OSError(28, "No space left on device", "fit.json"), 2, "error: fit.json: No space left on device\n"),
        (OSError("gone"), 2, "error: gone\n"),
        (ZeroDivisionError("x"), 1,
         "error: unexpected failure, a bug of eaid (ZeroDivisionError: x); EAID_DEBUG=1 shows where\n"),
    ],
)  # fmt: skip
def test_what_a_failure_looks_like(fault, code, told, run_eaid, monkeypatch):
    def fail(**_):
        raise fault

    monkeypatch.setattr(main, "load_command", lambda _name: fail)
    ran = run_eaid("demo")
    assert (ran.code, ran.out, ran.err) == (code, "", told)


def test_a_bug_is_shown_where_it_is_on_request(run_eaid, monkeypatch):
    monkeypatch.setenv("EAID_DEBUG", "1")
    monkeypatch.setattr(main, "load_command", lambda _name: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        run_eaid("demo")


def _into_another_failure():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise ImportError("initialization failed") from None


@pytest.mark.parametrize(
    "command",
    [*(partial(signal.raise_signal, number) for number in (signal.SIGINT, signal.SIGTERM)), _into_another_failure],
)
def test_a_signal_is_never_lost(command, run_eaid, monkeypatch):
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(main, "load_command", lambda _name: lambda **_: command())
    ran = run_eaid("demo")
    assert (ran.code, ran.err) == (130, "error: interrupted; nothing half-written is left\n")
    assert signal.getsignal(signal.SIGTERM) == before


def test_a_cause_is_told_once_however_many_logs_it_spoils(tmp_path, run_eaid):
    for k in range(30):
        (tmp_path / f"log_{k}.csv").write_text("stamp,load\n" + "".join(f"{i},{i % 7}\n" for i in range(20)))
    ran = run_eaid("fit", tmp_path, "-o", tmp_path / "fit.json")
    (said,) = [line for line in ran.err.splitlines() if line.startswith("error")]
    assert ran.code == 3 and said.endswith("(29 more alike: --verbose)") and "no column is called time" in said
    ran = run_eaid("fit", tmp_path, "-o", tmp_path / "fit.json", "--verbose")
    assert sum("no column is called time" in line for line in ran.err.splitlines()) == 30
