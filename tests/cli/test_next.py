"""Every command that the terminal or the page names as the next one runs as it is printed."""

import contextlib
import html
import os
import re
import shlex
from pathlib import Path

import pytest

FRICTION = "--repeats 2 --rate-hz 20 --hold 8 --idle 2"
SMALL = "--repeats 3 --rate-hz 20 --hold 30 --idle 2 --release 10"
FIRST = {
    "in % and N·m": [f"synth {SMALL} -o 'my logs'"],
    "a staircase": ["synth --excitation staircase -o 'my logs'"],
    "force": [f"synth --kind friction-force {FRICTION} -o 'my logs'"],
    "speed": [f"synth --kind friction-speed {FRICTION} -o 'my logs'"],
}
"""What each chain begins with; everything else is as it was printed."""
REAL = {
    "real clutch": (
        "fit REAL/ea-clutch --columns 'time=Time,output=\"Load Cell\"' --units time=us,output=N "
        "--name-pattern '_V={level}_' --step-at 2 --until 5 --repair -o fit.json"
    ),
    "real staircase": (
        "fit REAL/rigs/light_staircase.csv --columns time=2,input=3,output=1 --units time=us,output=mV -o fit.json"
    ),
}


def printed(ran):
    """Commands that a call names, in the order in which it names them."""
    return re.findall(r"next(?:: |   )(eaid .*)", ran.out + ran.err)


def run_chain(lines, run_eaid, least):
    """Run all lines, and those that they print, each command at most three times; a page at the end, and its own, which
    are to run from anywhere."""
    done, waiting, count = [], list(lines), {}
    while waiting:
        words = shlex.split(waiting.pop(0).removeprefix("eaid "))
        count[words[0]] = count.get(words[0], 0) + 1
        if words in done or count[words[0]] > 3:
            continue
        done.append(words)
        quick = ["--no-check"] if words[0] == "plan" else []
        anywhere = "-o" in words and os.path.isabs(words[words.index("-o") + 1])
        with contextlib.chdir("/" if anywhere else "."):
            ran = run_eaid(*words, *quick, "--force")
        assert ran.code == 0, (words, ran.err)
        waiting += printed(ran)
        if words[0] == "report":
            page = html.unescape(Path("report/report.html").read_text(encoding="utf-8"))
            waiting += re.findall(r"<code tabindex=\"0\">(eaid .*?)</code>", page)
    assert {words[0] for words in done} >= set(least.split())
    return done


@pytest.mark.parametrize("name", FIRST)
def test_what_is_printed_runs(name, run_eaid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    friction = name in ("force", "speed")
    run_chain(FIRST[name], run_eaid, "fit report" if friction else "fit tune-rc simulate report export")


def test_options_of_a_design_stay_in_what_mends_it(by_hand, run_eaid):
    by_hand({"data": {"input_unit": "V", "output_unit": "N", "levels": [30.0, 300.0], "sample_rate_hz": 1000.0}}, k=3)
    done = run_chain(
        ["tune-rc fit.json --kp 5 --pi-gains 21,360 -o gains.json"], run_eaid, "tune-rc simulate report export"
    )
    mended = [words for words in done[1:] if words[0] == "tune-rc"]
    assert all(words[1:6] == ["fit.json", "--kp", "5", "--pi-gains", "21,360"] for words in mended)


@pytest.mark.slow
@pytest.mark.parametrize("name", REAL)
def test_what_is_printed_of_recorded_logs_runs(name, run_eaid, realdata, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_chain([REAL[name].replace("REAL", str(realdata))], run_eaid, "fit tune-rc simulate report plan")
