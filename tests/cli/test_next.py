"""Every command that the terminal or the page names as the next one runs as it is printed."""

import contextlib
import html
import os
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

FRICTION = "--repeats 2 --rate-hz 20 --hold 8 --idle 2"
SMALL = "--repeats 3 --rate-hz 20 --hold 30 --idle 2 --release 10"
FIRST = {
    "in % and N·m": f"synth {SMALL} -o 'my logs'", "a staircase": "synth --excitation staircase -o 'my logs'",
    "force": f"synth --kind friction-force {FRICTION} -o 'my logs'",
    "speed": f"synth --kind friction-speed {FRICTION} -o 'my logs'", "odd names": "ingest odd",
    "unknown rig": "fit log.csv", "between levels": "fit levels.csv", "overshoot": "fit slips",
    "another share": "fit shares",
}  # fmt: skip
"""What each chain begins with; everything else is as it was printed."""
SLOW = ("a staircase", "force", "speed", "odd names", "between levels", "overshoot", "another share")
FASTER = {"plan": ["--no-check"], "report": ["--figures", "fig07,fig03"]}
OTHERS = {
    "another clutch": "fit RIGS/clutch --columns 'time=Time,output=\"Load Cell\"' --units time=us,output=N "
                      "--name-pattern '_V={level}_' --step-at 2 --until 5 --repair -o fit.json",
    "a lamp": "fit RIGS/lamp.csv --columns time=2,input=3,output=1 --units time=us,output=mV -o fit.json",
}  # fmt: skip
T = np.arange(0, 8, 0.02)
RISE = -np.expm1(-np.maximum(T - 2, 0) / 0.3)


def write(file, head, *columns):
    """A log of a stranger's rig, with the noise of a sensor."""
    file.parent.mkdir(exist_ok=True)
    columns[-1][:] += 0.004 * np.random.default_rng(len(file.name)).standard_normal(len(columns[-1]))
    np.savetxt(file, np.stack(columns, axis=1), "%.5f", ",", header=head, comments="")


def make(name):
    """The logs of a chain that begins with other logs than those of `eaid synth`."""
    drive = np.where(T < 2, 0, 2.0 + 2 * ((T - 2) // 1.5))  # a staircase that never comes back to rest
    follows, state = np.empty_like(T), 0.0
    for k, u in enumerate(drive if name == "between levels" else np.repeat([0, 5, 1, 7, 2, 8, 0, 4], 50)):
        follows[k], state = state, state + 0.02 / 0.4 * (u - state)
    if name == "odd names":  # no input column, microseconds that nothing says, the level in the name
        for volts in (100, 150, 200, 250):
            file = Path(f"odd/2024_V={volts}_f=1000_brass.csv")
            write(file, "Flag,Time,Load Cell", 0 * T, 1e6 * T, volts / 50 * RISE)
    elif name == "unknown rig":
        write(Path("log.csv"), "t,u,y", T, np.repeat([0.0, 5, 1, 7, 2, 8, 0, 4], 50), follows)
    elif name == "between levels":
        write(Path("levels.csv"), "time [s],drive [V],force [N]", T, drive, follows)
    elif name in ("overshoot", "another share"):
        two = sum(part * -np.expm1(-np.maximum(T - 2, 0) / tau) for part, tau in ((0.6, 0.2), (0.4, 1.5)))
        slips = RISE * np.where(T > 3, 1 - 0.3 * -np.expm1(-(T - 3) / 0.5), 1)
        for volts in (20, 40, 60, 80):
            for repeat in (1, 2, 3):
                file = Path(f"{'slips' if name == 'overshoot' else 'shares'}/{volts}V-{repeat}.csv")
                output = slips if name == "overshoot" else (1 + 0.01 * repeat) * two
                write(file, "time_s,voltage_v,force_n", T, np.where(T >= 2, volts, 0.0), volts / 20 * output)


def printed(ran):
    """Commands that a call names, in the order in which it names them."""
    return re.findall(r"^(?:.*next(?:: |   )(?:.*; as it is: )?|try: )(eaid .*)", ran.out + ran.err, re.M)


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
        anywhere = "-o" in words and os.path.isabs(words[words.index("-o") + 1])
        with contextlib.chdir("/" if anywhere else "."):
            ran = run_eaid(*words, *FASTER.get(words[0], []), "--force")
        asks = ran.code == 3 and "\ntry: eaid " in ran.err
        assert ran.code == 0 or asks, (words, ran.err)
        waiting += printed(ran)
        if words[0] == "report":
            page = html.unescape(Path("report/report.html").read_text(encoding="utf-8"))
            waiting += re.findall(r"<code tabindex=\"0\">(eaid .*?)</code>", page)
    assert {words[0] for words in done} >= set(least.split())
    return done


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in FIRST])
def test_what_is_printed_runs(name, run_eaid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make(name)
    friction = name in ("force", "speed")
    done = run_chain([FIRST[name]], run_eaid, "fit report" if friction else "fit tune-rc simulate report export")
    assert not any("--share" in one for one in done)  # a C that the runs tell is the fit's already


def test_options_of_a_design_stay_in_what_mends_it(by_hand, run_eaid):
    by_hand({"data": {"input_unit": "V", "output_unit": "N", "levels": [30.0, 300.0], "sample_rate_hz": 1000.0}}, k=3)
    first = "tune-rc fit.json --kp 5 --pi-gains 21,360 -o gains.json"
    done = run_chain([first], run_eaid, "tune-rc simulate report export")
    mended = [words for words in done[1:] if words[0] == "tune-rc"]
    assert all(words[1:6] == ["fit.json", "--kp", "5", "--pi-gains", "21,360"] for words in mended)


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_what_is_printed_of_recorded_logs_runs(name, run_eaid, rigs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    least = "fit tune-rc simulate report" + " plan" * (name == "a lamp")  # no plan mends a clutch that slips
    run_chain([OTHERS[name].replace("RIGS", str(rigs))], run_eaid, least)
