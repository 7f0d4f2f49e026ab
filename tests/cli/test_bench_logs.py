"""A folder as a bench leaves it, made here: level in the file name, µs, newtons, no input column, one broken log.

It stands in for recorded logs that are not part of the repository.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from eaid.cli.main import run

LEVELS, REPEATS, RATE = (100, 200, 300), 3, 100
BENCH = [
    "--columns", 'time=Time,output="Load Cell"', "--units", "time=us,output=N", "--name-pattern", "_V={level}_",
    "--step-at", "2.0", "--until", "5.0",
]  # fmt: skip


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Steps at 2 s that rise as two exponentials and fall at 5 s; the clock of one log starts anew at its end."""
    folder = tmp_path_factory.mktemp("bench")
    draw = np.random.default_rng(7)
    for level in LEVELS:
        for repeat in range(REPEATS):
            t = np.arange(7 * RATE) / RATE
            top = 0.02 * level * (1 + 0.02 * draw.standard_normal())
            risen = -0.85 * np.expm1(-(t - 2).clip(0) / 0.2) - 0.15 * np.expm1(-(t - 2).clip(0) / 1.5)
            force = top * np.where(t < 5, risen, risen[5 * RATE - 1] * np.exp(-(t - 5).clip(0) / 0.1))
            force += 0.05 + 0.005 * draw.standard_normal(t.size)
            rows = [f"{1e6 * a:.0f},{b:.5f}" for a, b in zip(t, force, strict=True)]
            if level == 200 and repeat == 1:
                rows.append(f"0,{force[-1]:.5f}")
            name = f"2024_V={level}_{repeat}.csv"
            (folder / name).write_text("\n".join(["Time,Load Cell", *rows]) + "\n")
    return folder


def test_the_broken_log_is_told_and_mended_on_request(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "d.h5")
    assert run(["ingest", str(bench), *BENCH, "-o", out]) == 3
    (said,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("error: "))
    assert "2024_V=200_1.csv" in said and "time falls at row 702 (0 s after 6.99 s)" in said
    assert run(["ingest", str(bench), *BENCH, "--repair", "-q", "--json", "-o", out]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [(level["level"], level["repeats"]) for level in result["levels"]] == [(u, REPEATS) for u in LEVELS]
    assert [level["repeats"] for level in result["releases"]] == [REPEATS] * len(LEVELS)
    assert (result["output_unit"], result["input_unit"]) == ("N", "")
    told = [one["code"] for run_ in result["runs"] if "V=200_1" in run_["name"] for one in run_["findings"]]
    assert "rows-dropped" in told


def test_its_fit_has_the_time_constants_it_was_made_of(bench: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit.json"
    assert run(["fit", str(bench), *BENCH, "--repair", "--ci", "none", "-q", "-o", str(out)]) in (0, 4)
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["data"]["levels"] == list(LEVELS) and result["data"]["repeats"] == [REPEATS] * len(LEVELS)
    for row in result["friction"]["levels"]:
        assert row["tau1"] == pytest.approx(0.2, rel=0.1) and row["Ts"] == pytest.approx(0.02 * row["level"], rel=0.05)
    assert result["release"]["tau1"] == pytest.approx(0.1, rel=0.2)
