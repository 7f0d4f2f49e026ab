from typing import Any

from eaid.report.results import Fit, Gains, Results, Source
from eaid.report.trust import BAD, CARE, GOOD, Verdict, verdict

SOLVED = {"converged": True, "message": "", "at_bounds": [], "starts": [{"cost": 1.0}]}
SOURCES = [{"path": "a.csv", "sha256": "0", "level": level, "samples": 20_000} for level in (20, 40) for _ in range(2)]


def fit(**parts: Any) -> Results:
    content = {"data": {"kind": "clutch", "sources": SOURCES, "sample_rate_hz": 1000.0}, **parts}
    return Results(fits=(Fit(Source("fit.json", "0", "fit"), content),))


def texts(results: Results, grade: str) -> list[str]:
    return [point.text for point in verdict(results).points if point.grade == grade]


def test_a_clean_fit_can_be_trusted():
    found = verdict(fit(linear={"a0": 1, "b0": 1, "c0": 0, "solver": SOLVED, "warnings": []}))
    assert found.grade == GOOD
    assert found.headline == "Can be trusted within the recorded range."
    assert found.points[0].about == "linear model"


def test_a_fit_that_did_not_converge_comes_first():
    failed = {"converged": False, "message": "the gradient is not zero"}
    found = verdict(fit(linear={"solver": SOLVED, "warnings": ["x"]}, nonlinear={"solver": failed}))
    assert found.grade == BAD
    assert found.headline == "Do not rely on this yet: settle what is said of the nonlinear model first."
    assert found.points[0].text == "Did not converge (the gradient is not zero); do not use the values."


def test_models_that_the_data_cannot_settle_are_a_stop():
    part = {"solver": SOLVED, "identifiable": False, "not_identifiable_because": ["one level only"]}
    assert texts(fit(nonlinear=part), BAD) == ["These data cannot settle it: one level only."]


def test_limits_warnings_and_open_points_are_one_subject():
    part = {
        "solver": {**SOLVED, "at_bounds": ["τ2 ≥ τ1 at 10 %"]},
        "warnings": ["tau2 falls"],
        "open": ["o", "tau2 falls"],
    }
    found = verdict(fit(nonlinear=part))
    assert found.grade == CARE
    assert found.headline == "Usable within the recorded range, with one reservation: read them below."
    first = "Leans on a limit (τ2 ≥ τ1 at 10 %): the data pull beyond what is physical there."
    assert found.groups[0] == (CARE, "nonlinear model", [first, "τ2 falls.", "O."])


def test_single_runs_short_records_and_wide_intervals_are_told():
    level = {"level": 20, "Ts": 1.0, "tau1": 0.2, "tau2": 30.0, "ci95": {"tau1": [0.1, 0.3]}}
    said = " ".join(texts(fit(friction={"levels": [level], "solver": SOLVED, "warnings": []}), CARE))
    assert "longer than the recording (20.0 s)" in said
    assert "τ1 is weakly known at level 20" in said
    once = {"kind": "clutch", "sources": SOURCES[:1], "sample_rate_hz": 1000.0}
    assert any("recorded once only" in text for text in texts(fit(data=once, linear={"solver": SOLVED}), CARE))


def test_synthetic_data_and_an_open_guarantee_are_said():
    synthetic = {"kind": "clutch", "sources": SOURCES, "synthetic": "the reference plant"}
    found = verdict(fit(data=synthetic, linear={"solver": SOLVED}))
    assert found.headline == "Consistent in itself, but made from synthetic data."
    assert found.points[0].text == "Synthetic (the reference plant): nothing here was measured on a rig."
    content = {"rc": {"guaranteed": False}, "warnings": ["the PI: too slow"]}
    gains: Verdict = verdict(Results(gains=(Gains(Source("gains.json", "0", "gains"), content),)))
    assert [about for _grade, about, _texts in gains.groups] == ["robust gains", "PI gains"]
    assert "not guaranteed by the inequality (15)" in gains.points[0].text


def test_a_file_without_a_model_is_a_stop():
    assert texts(fit(), BAD) == ["The file holds no model."]
