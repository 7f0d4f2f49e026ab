"""Every sentence replaced by its code: fits, adequacy and plans come out the same; and the words of each template."""

from dataclasses import replace
from typing import Any

import pytest

from eaid.findings import Finding, finding, say
from eaid.findings.row import Row
from eaid.findings.sentences import SENTENCES, fitting
from eaid.options import PlanOptions
from eaid.planning.recordings import plan_recordings
from eaid.results import codec
from eaid.results.fit import Fit
from eaid.uncertainty.workflow import fit_steps


def without_texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: without_texts(item) for key, item in value.items() if key != "text"}
    return [without_texts(item) for item in value] if isinstance(value, list) else value


def results(made: Any) -> tuple[Any, Any]:
    fit: Fit = fit_steps(made)
    plan = plan_recordings(fit, PlanOptions({"Ts": 4.0}, check=False))
    return without_texts(codec.to_plain(fit)), without_texts(codec.to_plain(plan))


@pytest.mark.slow
@pytest.mark.parametrize(("variant", "seed"), [("base", 3), ("share", 3), ("sweeps", 1), ("single", 2)])
def test_no_result_depends_on_a_sentence(sets: Any, monkeypatch: pytest.MonkeyPatch, variant: str, seed: int) -> None:
    made = sets.one_set(seed, sets.VARIANTS[variant], samples=500)
    before = results(made)
    for code, row in list(SENTENCES.items()):
        monkeypatch.setitem(SENTENCES, code, replace(row, template=code.replace("{", "").replace("}", "")))
    told = finding("single-runs", "data")
    assert say(told) == "single-runs"
    assert results(made) == before


V = {
    "levels": (10.0, 20.0), "unit": "%", "output_unit": "N·m", "parameter": "tau2", "parameters": ("Ts",), "low":
    1.0, "high": 2.0, "low_s": 1.0, "high_s": None, "record_s": 3.0, "curve_half_width": 0.01, "taus_s": (0.2,
    0.3), "p": 5.0, "r1": -4.0, "count": 3, "of": 10, "cause": "short-record", "sweeps": 3, "runs": 30, "ratio":
    2.0, "convention": "zero", "several": True, "C": 0.85, "estimate": 0.88, "held": 0.85, "differ": False,
    "worst": 10.0, "joint": 1.0, "two_stage": 2.0, "gain_pct": 3.0, "weak": ("tau2",), "equal": 1.0, "sd": 2.0,
    "repeats": 3, "because": "spread-rises", "believe": "sd", "lost_pct": 26.0, "shape": "a shape",
    "usual": "two exponentials", "rmse": 0.1, "usual_rmse": 0.2, "closer_pct": 3.0, "systematic": 0.01, "Ts": 4,
    "fault": "singular", "pct": 7.0, "plants": 100, "width_pct": 6.0, "wanted_pct": 5.0, "scatter_pct": 3.0, "open": 6,
    "why": "record", "half_width": 0.1, "rising": True, "keys": ("nonlinear.Ts",), "names": ("Ts",),
}  # fmt: skip


@pytest.mark.parametrize("code", list(fitting.INTERVAL_ROWS))
def test_every_template_makes_one_sentence_of_its_values(code: str) -> None:
    row: Row = fitting.INTERVAL_ROWS[code]
    values = {key: value for key, value in V.items() if key != "levels"}
    said = say(Finding(code, row.severity, "nonlinear", (10.0, 20.0), values))
    assert said and "{" not in said and said != code and not said.endswith(".") and "None" not in said
