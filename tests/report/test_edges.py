"""Logs of closed loops: their edges by formula, kept whole in data.h5, and their page."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eaid.cli.main import run
from eaid.report.page import summary
from eaid.report.page.known import known
from eaid.report.page.next_steps import next_steps
from eaid.report.results import Results, edge_logs, read_results
from eaid.report.tables.recorded import edges_table
from eaid.steps.edges import edges

T = np.arange(6000) * 1e-2
OMEGA, ZETA = 6.0, 0.5
OVERSHOOT = 100 * np.exp(-np.pi * ZETA / np.sqrt(1 - ZETA**2))


def second_order(t: np.ndarray) -> np.ndarray:
    """Step response of a damped oscillator."""
    swing = OMEGA * np.sqrt(1 - ZETA**2)
    decay = np.exp(-ZETA * OMEGA * t)
    known = 1 - decay * (np.cos(swing * t) + ZETA / np.sqrt(1 - ZETA**2) * np.sin(swing * t))
    return np.where(t > 0, known, 0.0)


REFERENCE = np.select([T < 5, T < 20, T < 40], [1.0, 3.0, 2.0], 4.0)
OUTPUT = 1 + 2 * second_order(T - 5) - second_order(T - 20) + 2 * second_order(T - 40)
"""Three jumps of the reference; the output settles at each of its values."""


def test_a_reference_tells_its_edges():
    found = edges(T, OUTPUT, REFERENCE)
    assert [one.at_s for one in found] == pytest.approx([5.1, 20.1, 40.1], abs=0.06)
    assert [one.after for one in found] == pytest.approx([3, 2, 4], abs=1e-3)
    within = T[np.argmax(second_order(T) >= 0.9)] - T[np.argmax(second_order(T) >= 0.1)]
    for one in found:
        assert one.overshoot_pct == pytest.approx(OVERSHOOT, abs=1.0)
        assert one.rise_s == pytest.approx(within, abs=0.08)


def test_a_smooth_reference_leaves_the_edges_to_the_output():
    smooth = 2 + np.sin(0.3 * T)
    assert edges(T, OUTPUT, smooth) == edges(T, OUTPUT)


def written(folder: Path, with_reference: bool, with_input: bool) -> Path:
    columns = {"time_s": T, "torque_nm": OUTPUT + 0.002 * np.random.default_rng(1).normal(size=len(T))}
    if with_reference:
        columns["reference_nm"] = REFERENCE
    if with_input:
        columns["duty_pct"] = 20 * OUTPUT
    path = folder / "loop.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")
    assert run(["ingest", "--edges", str(path), "-o", str(folder / "loop.h5"), "-q"]) == 0
    return folder / "loop.h5"


def light(given: Results) -> tuple[str, str]:
    one = summary.lights(given, known(given))[0]
    return one.grade, one.text


def test_a_loops_log_is_kept_whole_and_has_its_table(tmp_path: Path):
    given = read_results([written(tmp_path, with_reference=True, with_input=True)])
    (log,) = given.edge_logs
    assert len(log.run.time_s) == len(T) and log.goals == [3.0, 2.0, 4.0]
    assert log.rms_error == pytest.approx(float(np.sqrt(np.mean((REFERENCE - OUTPUT) ** 2))), abs=1e-3)
    table = edges_table(given.edge_logs)
    assert [row[0] for row in table.rows] == [1, 2, 3] and "asked for (N·m)" in table.heads
    assert [row[5] for row in table.rows] == pytest.approx([0, 0, 0], abs=2e-3)  # left over
    assert light(given) == ("good", "closed loop, 3 edges")
    assert summary.title(given) == "Edges of a closed loop"
    shown = {tile.label: tile.value for tile in summary.tiles(given)}
    assert len(shown) == 6 and shown["edges"] == "3" and shown["largest edge"] == "2.00 N·m"
    (step,) = next_steps(given, known(given))
    assert step.command.startswith("eaid fit ")


def test_an_output_alone_says_what_a_model_needs(tmp_path: Path):
    given = read_results([written(tmp_path, with_reference=False, with_input=False)])
    assert light(given) == ("good", f"1 log, {len(given.edge_logs[0].edges)} edges")
    assert summary.title(given) == "Edges of the output"
    assert "asked for (N·m)" not in edges_table(given.edge_logs).heads
    assert "LOGS" in next_steps(given, known(given))[0].command


def test_a_still_output_has_no_edge(tmp_path: Path):
    path = tmp_path / "still.csv"
    noise = np.random.default_rng(1).normal(size=len(T))
    np.savetxt(path, np.column_stack([T, 1 + 0.01 * noise]), delimiter=",", header="time_s,torque_nm", comments="")
    assert run(["ingest", "--edges", str(path), "-o", str(tmp_path / "still.h5"), "-q"]) == 0
    given = read_results([tmp_path / "still.h5"])
    assert light(given) == ("care", "1 log, no edge")
    assert run(["report", str(tmp_path / "still.h5"), "-o", str(tmp_path / "page"), "-q"]) == 0


@pytest.mark.slow
def test_its_page_shows_it_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    data = written(tmp_path, with_reference=True, with_input=False)
    assert run(["report", str(data), "-o", str(tmp_path / "page"), "--json"]) == 0
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert told["figures"] == ["edges"]
    text = (tmp_path / "page/report.html").read_text(encoding="utf-8")
    assert text.count('class="picture"') == 2 and "<h3>Edges of the output</h3>" in text


@pytest.mark.slow
def test_steps_are_no_loop():
    from eaid.synth.datasets import shipped

    given = read_results([shipped()["clutch"]])
    assert given.edge_logs == () == edge_logs(given.data[0].result.steps)
