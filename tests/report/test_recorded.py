"""The page of logs that were fitted as recorded, each made, fitted and reported by the commands themselves."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from eaid.cli.main import run
from eaid.report.results import read_results
from eaid.report.tables import recorded

KINDS = ("random", "prbs", "chirp", "closed-loop")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The fit of a log of each kind, and its page."""
    folder = tmp_path_factory.mktemp("recorded")

    def call(*arguments: str | Path) -> int:
        return run([str(argument) for argument in arguments])

    logs = [folder / kind for kind in KINDS]
    for seed, (kind, log) in enumerate(zip(KINDS, logs, strict=True)):
        shape = ["--shape", "duration_s=60", "--rate-hz", "100", "--seed", str(seed)]
        assert call("synth", "--excitation", kind, *shape, "-o", log, "-q") == 0
    assert call("fit", *logs, "-o", folder / "fit.json", "-q") == 0
    assert call("report", folder / "fit.json", "-o", folder / "report", "-q") == 0
    return folder / "fit.json", folder / "report/report.html"


@pytest.fixture(scope="module")
def told(made: tuple[Path, Path]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(made[0].read_text(encoding="utf-8"))["recorded"]
    return found


def test_logs_as_recorded_and_their_bode_plot_are_on_the_page(made: tuple[Path, Path]):
    text = made[1].read_text(encoding="utf-8")
    model = text.split('<section id="model">')[1].split("</section>")[0]
    first, bode = (model.index(f'id="{name}"') for name in ("recorded_logs", "bode"))
    assert first < bode < model.index("<h3>Logs fitted as recorded</h3>") < model.index("<details")
    assert "Frequency response" in model and "Closed loops as recorded" in model
    assert "What the input asked about" in model and "<dfn>coherence</dfn>" in text
    assert "4 logs as recorded, 240 s" in text
    assert text.count('class="picture"') == 2
    for name in ("recorded_logs", "bode"):
        assert (made[1].parent / f"figures/{name}.png").stat().st_size > 10_000


def test_the_tables_say_what_the_fit_says(made: tuple[Path, Path], told: dict[str, Any]):
    fit = read_results([made[0]]).fits[0].result
    logs, responses, loops, asked, _falls = recorded.recorded_tables(fit)
    assert [row[-2:] for row in logs.rows] == [(one["fit_pct"], one["one_step_pct"]) for one in told["logs"]]
    assert [row[0] for row in responses.rows] == [one["name"] for one in told["responses"]] != []
    assert [row[5] for row in responses.rows] == [one["harmonics_pct"] for one in told["responses"]]
    assert [row[5] for row in loops.rows] == [told["loops"][0]["rms_error"]]
    assert [row[2:] for row in asked.rows] == [(one["Ts"], one["tau1"], one["tau2"]) for one in told["asked"]]


def test_the_tiles_have_the_intervals_of_the_models_curve(made: tuple[Path, Path]):
    fit = json.loads(made[0].read_text(encoding="utf-8"))["nonlinear"]
    low, high = fit["curves"][-1]["ci95"]["tau1"]
    tiles = made[1].read_text(encoding="utf-8").split('<dl class="tiles">')[1].split("</dl>")[0]
    assert re.search(rf"{low:.3f} … {high:.3f}, 95 %; fast time constant", tiles)
