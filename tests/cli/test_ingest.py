"""`eaid ingest`: its table and JSON, bad and damaged logs, logs as benches leave them."""

import json
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import eaid


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write_log(name, level=50.0, rows=2000):
    t = np.arange(rows) / 100.0
    u = np.where(t >= 5, level, 0.0)
    y = 0.1 + np.where(t >= 5, 0.04 * level * -np.expm1(-(t - 5) / 0.4), 0.0) + 0.01 * np.sin(999 * t)
    lines = ["time_s,duty_pct,torque_nm", *(f"{a:.2f},{b:g},{c:.6f}" for a, b, c in zip(t, u, y, strict=True))]
    Path(name).write_text("\n".join(lines) + "\n")
    return name


def test_table_json_and_file(run_eaid):
    logs = [write_log(f"u{level}.csv", level) for level in (30, 60)]
    ran = run_eaid("ingest", *logs)
    assert ran.code == 0 and ran.out.splitlines()[0] == "clutch: 2 levels, 2 runs, 100 Hz"
    assert ran.out.splitlines()[3].split() == ["30", "1", "0", "0.100", "1.200", "0", "14.99", "0"]
    assert len(ran.out.splitlines()) == 5  # a line a level
    assert ran.err.splitlines() == [
        "reading logs: 2 to do",
        "columns of 2 logs: time = time_s [s], input = duty_pct [%], output = torque_nm [N·m]; left: none",
        "data.h5: 2 levels, 2 runs; next: eaid fit data.h5",
    ]
    told = json.loads(run_eaid("ingest u30.csv --json --force").out)
    assert told["levels"] == [{"level": 30.0, "repeats": 1, "samples": 1500, "runs": ["u30"]}]
    (row,) = told["runs"]
    assert (row["step_s"], row["source"], row["findings"]) == (5.0, "u30.csv", [])


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """As a bench leaves it: level in the file name, µs, newtons, no input; up at 2 s, down at 5 s, one bad log."""
    folder, draw, rate = tmp_path_factory.mktemp("bench"), np.random.default_rng(7), 100
    for level in (100, 200, 300):
        for repeat in range(3):
            t = np.arange(7 * rate) / rate
            top = 0.02 * level * (1 + 0.02 * draw.standard_normal())
            risen = -0.85 * np.expm1(-(t - 2).clip(0) / 0.2) - 0.15 * np.expm1(-(t - 2).clip(0) / 1.5)
            force = top * np.where(t < 5, risen, risen[5 * rate - 1] * np.exp(-(t - 5).clip(0) / 0.1))
            force += 0.05 + 0.005 * draw.standard_normal(t.size)
            rows = [f"{1e6 * a:.0f},{b:.5f}" for a, b in zip(t, force, strict=True)]
            rows += [f"0,{force[-1]:.5f}"] if (level, repeat) == (200, 1) else []  # its clock starts anew at its end
            (folder / f"2024_V={level}_{repeat}.csv").write_text("\n".join(["Time,Load Cell", *rows]) + "\n")
    return folder


def test_the_readmes_own_logs_are_read_as_it_says(bench, run_eaid):
    shutil.copytree(bench, "bench")
    page = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    block = page.split("## Your own logs")[1].split("```")[1].replace("\\\n", " ")
    lines = [shlex.split(line.removeprefix("$ eaid ")) for line in block.splitlines() if line.startswith("$ ")]
    assert [words[0] for words in lines] == ["ingest", "fit"]
    first, second = (run_eaid(words) for words in lines)
    assert first.code == second.code == 0 and "bench/dataset.toml: written; eaid ingest bench needs no" in first.err
    told = [run.name for run in eaid.read("bench.h5").runs if "rows-dropped" in [one.code for one in run.findings]]
    assert told == ["2024_V=200_1"]
    fit = json.loads(Path("bench.json").read_text(encoding="utf-8"))
    assert [(row["level"], row["Ts"]) for row in fit["friction"]["levels"]] == [
        (level, pytest.approx(0.02 * level, rel=0.05)) for level in (100, 200, 300)
    ]
    assert fit["data"]["repeats"] == [3, 3, 3] and fit["release"]["tau1"] == pytest.approx(0.1, rel=0.2)
