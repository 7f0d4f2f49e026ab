"""The page of logs fitted as recorded, of closed loops' edges, of hours at 10 kHz and of hundreds of levels."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import eaid
from eaid.logs.read import read_runs
from eaid.report.panels import thinned
from eaid.report.results import shortened


@pytest.fixture(scope="module")
def told(recorded: Path) -> dict[str, Any]:
    return json.loads(recorded.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def logs(recorded: Path, report: Callable[..., Any]) -> Any:
    return report(recorded)


def test_logs_as_recorded_and_their_bode_plot_are_on_the_page(logs: Any):
    model = logs.html.split('<section id="model">')[1].split("</section>")[0]
    first, bode = (model.index(f'id="{name}"') for name in ("recorded_logs", "bode"))
    assert first < bode < model.index("<h3>Logs fitted as recorded</h3>") < model.index("<details")
    assert "<dfn>coherence</dfn>" in logs.html and "4 logs as recorded, 240 s" in logs.chips
    assert (
        logs.html.count('class="picture"') == 2
        and "3 of 4 logs: the best, the middle" in logs.captions["recorded_logs"]
    )


def test_its_tables_say_what_the_fit_says(logs: Any, told: dict[str, Any]):
    def close(shown: list[str], wanted: list[float | None]) -> bool:
        numbers = [np.nan if text == "–" else float(text.replace("−", "-")) for text in shown]
        return numbers == pytest.approx([np.nan if x is None else x for x in wanted], rel=0.05, nan_ok=True)

    known = told["recorded"]
    rows = logs.rows("Logs fitted as recorded")
    assert close([row[-2] for row in rows], [one["fit_pct"] for one in known["logs"]])
    assert close([row[-1] for row in rows], [one["one_step_pct"] for one in known["logs"]])
    rows, responses = logs.rows("Frequency response"), [one for one in known["responses"] if one["frequency_hz"]]
    assert [row[0] for row in rows] == [one["name"] for one in responses] != []
    assert close([row[5] for row in rows], [one["harmonics_pct"] for one in responses])
    assert close([row[5] for row in logs.rows("Closed loops as recorded")], [known["loops"][0]["rms_error"]])
    for k, name in enumerate(("Ts", "tau1", "tau2")):
        assert close(
            [row[2 + k] for row in logs.rows("What the input asked about")], [one[name] for one in known["asked"]]
        )
    low, high = told["nonlinear"]["curves"][-1]["ci95"]["tau1"]
    assert f"({low:.3g} … {high:.3g})" in logs.numbers["Values with 95 % intervals"][-1][2]


T = np.arange(6000) * 1e-2
OMEGA, ZETA = 6.0, 0.5
OVERSHOOT = 100 * np.exp(-np.pi * ZETA / np.sqrt(1 - ZETA**2))


def second_order(t: np.ndarray) -> np.ndarray:
    """Step response of a damped oscillator."""
    swing, decay = OMEGA * np.sqrt(1 - ZETA**2), np.exp(-ZETA * OMEGA * np.maximum(t, 0))
    return np.where(t > 0, 1 - decay * (np.cos(swing * t) + ZETA / np.sqrt(1 - ZETA**2) * np.sin(swing * t)), 0.0)


REFERENCE = np.select([T < 5, T < 20, T < 40], [1.0, 3.0, 2.0], 4.0)
OUTPUT = 1 + 2 * second_order(T - 5) - second_order(T - 20) + 2 * second_order(T - 40)
"""Three jumps of the reference; the output settles at each of its values."""


@pytest.fixture
def loop(tmp_path: Path, run_eaid: Callable[..., Any]) -> Callable[..., Path]:
    """A log of a closed loop with some of its columns, ingested."""

    def made(**columns: np.ndarray) -> Path:
        held = {"time_s": T, **columns}
        head = ",".join(held)
        np.savetxt(tmp_path / "loop.csv", np.column_stack(list(held.values())), delimiter=",", header=head, comments="")
        out = tmp_path / f"{'-'.join(columns)}.h5"
        assert run_eaid("ingest", "--edges", tmp_path / "loop.csv", "-o", out, "-q", "--force").code == 0
        return out

    return made


def test_edges_of_a_loop_by_formula(loop: Callable[..., Path], report: Callable[..., Any]):
    noisy = OUTPUT + 0.002 * np.random.default_rng(1).normal(size=len(T))
    page = report(loop(torque_nm=noisy, reference_nm=REFERENCE, duty_pct=20 * OUTPUT))
    rows = np.array([[float(cell.replace("−", "-")) for cell in row[1:]] for row in page.rows("Edges of the output")])
    _k, at_s, before, after, goal, left, rise_s, overshoot, _settled = rows.T
    assert at_s == pytest.approx([5.1, 20.1, 40.1], abs=0.06) and list(goal) == [3, 2, 4]
    assert before == pytest.approx([1, 3, 2], abs=2e-3) and after == pytest.approx([3, 2, 4], abs=2e-3)
    assert left == pytest.approx([0, 0, 0], abs=2e-3) and overshoot == pytest.approx([OVERSHOOT] * 3, abs=1.0)
    within = T[np.argmax(second_order(T) >= 0.9)] - T[np.argmax(second_order(T) >= 0.1)]
    assert rise_s == pytest.approx([within] * 3, abs=0.08)
    assert page.lights[0] == ("good", "1 log, 3 edges") and page.title == "Edges of the output" and not page.numbers
    assert "3 edges of 1 log" in page.captions["edges"] and {"output", "reference", "input"} == set(page.lines("edges"))
    ((_why, command),) = page.steps
    assert command.startswith("eaid fit ") and command.endswith(".h5 -o fit.json")


def test_an_output_alone_says_what_a_model_needs_and_a_still_one_has_no_edge(loop: Any, report: Callable[..., Any]):
    page = report(loop(torque_nm=OUTPUT))
    assert {row[5] for row in page.rows("Edges of the output")} == {"–"} and "LOGS" in page.steps[0][1]
    still = report(loop(torque_nm=1 + 0.01 * np.random.default_rng(1).normal(size=len(T))))
    assert still.lights[0] == ("care", "1 log, 0 edges")


def test_long_runs_become_means_that_begin_at_the_step(files: dict[str, Path], monkeypatch: pytest.MonkeyPatch):
    run = read_runs([files["clutch.h5"]], eaid.ReadOptions())[0]
    assert shortened(run) == (run, 1)
    monkeypatch.setitem(shortened.__globals__, "MOST", 150)
    short, every = shortened(run)
    start, first = (int(np.searchsorted(one.time_s, run.step_s)) for one in (run, short))
    assert every == -(-len(run.time_s) // 150) and len(short.time_s) <= 150
    for k in (first, first + 7):
        block = slice(start + (k - first) * every, start + (k - first + 1) * every)
        assert short.output[k] == pytest.approx(np.mean(run.output[block]), rel=1e-12)
        assert short.time_s[k] == pytest.approx(np.mean(run.time_s[block]), rel=1e-12)
        assert short.input[k] == run.input[block][0]
    assert short.input[first - 1] == run.input[start - 1] != short.input[first]


@given(st.integers(2, 5000), st.integers(4, 200), st.integers(0, 2**32 - 1))
def test_thinned_curves_keep_ends_and_extremes_in_order(n: int, points: int, seed: int):
    y = np.random.default_rng(seed).normal(size=n)
    t, few = thinned(np.arange(float(n)), y, points)
    assert t[0] == 0 and t[-1] == n - 1 and np.all(np.diff(t) > 0) and np.array_equal(y[t.astype(int)], few)
    assert few.max() == y.max() and few.min() == y.min() and len(few) <= max(points, 2) + 4
