"""The printed tables of `eaid fit` hold the numbers that stand in fit.json, and say which estimate is used."""

import json
import re
from pathlib import Path

import pytest

from eaid.cli import main
from eaid.report.tables.table import number


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five levels, three repeats each."""
    path = tmp_path_factory.mktemp("tables") / "noisy.h5"
    code = main.run(
        ["synth", "--levels", "20,40,60,80,100", "--repeats", "3", "--hold", "8", "--idle", "1", "--rate-hz", "50",
         "-o", str(path), "-q"]
    )  # fmt: skip
    assert code == 0
    return path


def table(text: str, title: str) -> list[list[str]]:
    """The cells of one printed table, its head first."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"{title}. "))
    return [re.split(r" {2,}", line) for line in lines[start + 1 : start + 12]]


@pytest.mark.parametrize(
    ("arguments", "first"),
    [
        (["--estimator", "joint"], "joint"),
        (["--estimator", "two-stage"], "two-stage"),
    ],
)
def test_the_first_column_is_the_model_of_the_file(
    arguments: list[str], first: str, noisy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "fit.json"
    assert main.run(["fit", str(noisy), "-o", str(out), "--hold-out", "60", "--verbose", *arguments]) == 0
    told, part = capsys.readouterr().out, json.loads(out.read_text())["nonlinear"]
    rows = table(told, "Nonlinear model")
    assert rows[0][2] == f"ours, {first} (used)"
    shown = {row[0]: row[2] for row in rows[1:] if len(row) > 2}
    assert [shown[f"b_{k}"] for k in range(3)] == [number(c) for c in part["tau2"]]
    held = next(row for row in table(told, "Levels held out") if row[0] == "nonlinear")
    assert held[1:3] == ["60", number(part["hold_out"]["levels"][0]["rmse"], 3)]
    assert [head for head in table(told, "Estimates side by side")[0] if head.endswith("(used)")]


def test_huber_shows_the_run_and_the_part_it_weighs_down(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A drop-out of half a second in one run of one level is found, told and left out."""
    made = ["synth", "--levels", "20,40,60,80,100", "--repeats", "3", "--hold", "8", "--idle", "1", "--rate-hz", "50"]
    assert main.run([*made, "-o", str(tmp_path / "logs"), "-q"]) == 0
    (log,) = (tmp_path / "logs").glob("*060*r2*.csv")
    lines = []
    for line in log.read_text().splitlines():
        cells = line.split(",")
        fallen = cells[0][:1].isdigit() and 5.0 < float(cells[0]) < 5.5
        lines.append(",".join([*cells[:-1], "0.0"]) if fallen else line)
    log.write_text("\n".join(lines) + "\n")
    out = tmp_path / "fit.json"
    assert (
        main.run(["fit", str(tmp_path / "logs"), "-o", str(out), "--loss", "huber", "--ci", "none", "--tables"]) == 4
    )  # steps say that it stood still
    told = capsys.readouterr().out
    part = json.loads(out.read_text())["nonlinear"]["robust"]["weights"][2]
    assert part["level"] == 60
    worst = min(part["parts"], key=lambda one: one["least"])
    assert "r2" in worst["run"] and 3.9 < worst["from_s"] < 4.1 and 4.4 < worst["to_s"] < 4.6
    rows = table(told, "Weights of Huber's loss, nonlinear model")
    assert rows[3][0] == "60 %" and "r2)" in rows[3][-1]
