"""One small set of files for all commands: `made` once, `rig` a copy of it in which a test may run and write."""

import contextlib
import json
import shutil

import pytest

from eaid.cli import main

from ..conftest import GAINS, PLANT

SMALL = "--levels 20,40,60,80,100 --repeats 2 --rate-hz 20 --hold 8 --idle 1 --release 2 -q"
FILES = {
    "reference.csv": "time_s,reference_nm\n0,0\n1,1\n5,1\n", "duty.csv": "time_s,duty_pct\n0,0\n1,50\n9,0\n",
    "text.json": "hello", "plan.json": '{"schema": "eaid/plan/1"}',
}  # fmt: skip


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """data.h5 and the same logs as CSV, their fit.json and gains.json, the fit of a friction rig, small tables."""
    folder = tmp_path_factory.mktemp("made")
    with contextlib.chdir(folder):
        for line in (
            f"synth {SMALL} -o data.h5",
            f"synth {SMALL} -o logs",
            "fit data.h5 -q -o fit.json",
            "tune-rc fit.json -q -o gains.json",
            "synth --kind friction-force --repeats 2 --rate-hz 20 --hold 8 -q -o force.h5",
            "fit force.h5 -q -o force.json",
        ):
            assert main.run(line.split()) == 0, line
    min((folder / "logs").iterdir()).rename(folder / "logs" / "log.csv")
    (folder / "empty").mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture
def run_eaid(run_eaid):
    """As everywhere, the first words in one text or list: `run_eaid("fit data.h5 -q -o", path)`."""

    def run(first=(), *more):
        return run_eaid(*(first.split() or [first] if isinstance(first, str) else first), *more)

    return run


@pytest.fixture
def rig(made, tmp_path, monkeypatch):
    """A copy of `made`, in which the command runs."""
    folder = tmp_path / "rig"
    shutil.copytree(made, folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="session")
def held():
    """Every regular file below a folder, hidden ones too."""

    def held(folder):
        return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}

    return held


def paper(k=1.0, y=1.0, pace=1.0):
    """fit.json of a user's script: the paper's models, inputs `k` times, outputs `y` times, `pace` times as fast."""
    by = {"tau1": 1 / pace, "tau2": 1 / pace, "Ts": y}
    return {
        "schema": "eaid/fit/2",
        "nonlinear": {
            "C": 0.85, "u_range": [10.0 * k, 100.0 * k],
            **{name: [size * c / k**i for i, c in enumerate(PLANT[name])] for name, size in by.items()},
        },
        "linear": {
            "a0": 1.36 * pace, "b0": 0.08 * pace * y / k, "c0": -2.42 * pace * y,
            "bounds": {"convention": "zero-offset", "B_m": 12.4 * k / y / pace, "B_M": 42.6 * k / y / pace},
        },
    }  # fmt: skip


@pytest.fixture
def by_hand(tmp_path, monkeypatch):
    """In an empty folder: gains.json with the published gains, fit.json of `paper(**scales)` with other `parts`."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gains.json").write_text(json.dumps(GAINS))

    def write(parts=None, **scales):
        content = {name: part for name, part in {**paper(**scales), **(parts or {})}.items() if part is not None}
        (tmp_path / "fit.json").write_text(json.dumps(content))

    write()
    return write


@pytest.fixture(autouse=True)
def _no_colour_of_the_tester(monkeypatch):
    for name in ("NO_COLOR", "COLUMNS", "EAID_DEBUG"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def volts():
    """What fit.json says of a rig in V and N, to go with `k=3, y=0.5`."""
    return {"input_unit": "V", "output_unit": "N", "levels": [30.0, 300.0], "sample_rate_hz": 1000.0}
