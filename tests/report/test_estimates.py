"""Estimates side by side, Huber's weights, the recommendation and the words of open values on the page."""

from typing import Any

import pytest

from eaid.cli import main
from eaid.fitting.side_by_side import advice, nonlinear_estimates
from eaid.report import details, live, tables
from eaid.report.estimates import estimates, huber
from eaid.report.figures import clutch
from eaid.store import read_json


@pytest.fixture(scope="module")
def fits(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """One small set fitted by the joint and by the two-stage estimator, and with Huber's loss."""
    folder = tmp_path_factory.mktemp("estimates")
    data = str(folder / "data.h5")
    how = ["--levels", "20,40,60,80,100", "--repeats", "3", "--hold", "8", "--idle", "1", "--rate", "50"]
    assert main.run(["synth", *how, "-o", data, "-q"]) == 0
    made = {}
    for name, options in {
        "joint": [], "two-stage": ["--estimator", "two-stage"], "huber": ["--loss", "huber", "--ci", "none"],
    }.items():  # fmt: skip
        path = folder / f"{name}.json"
        assert main.run(["fit", data, "-o", str(path), "-q", *options]) == 0
        made[name] = read_json(path, "fit")
    return made


def test_all_estimates_stand_beside_each_other_with_advice(fits: dict[str, dict[str, Any]]) -> None:
    first, linear = estimates(fits["joint"])
    assert first.columns[2] == "joint, equal weights (used)" and first.columns[4] == "two-stage"
    assert first.columns[6] == "joint, sd weights" and len(first.rows) == 15
    other = fits["joint"]["nonlinear"]["other_weights"]["curves"][0]["Ts"]
    assert first.rows[0][:2] == ("20 %", "T_s (N·m)") and first.rows[0][6] == tables.number(other)
    for said in advice(fits["joint"]["nonlinear"]):
        assert said in first.caption
    assert linear.columns[1::2] == ("equal weights (used)", "sd weights") and "believe equal weights" in linear.caption


def test_the_page_leads_with_the_estimate_that_is_used(fits: dict[str, dict[str, Any]]) -> None:
    fit = fits["two-stage"]
    assert next(iter(nonlinear_estimates(fit["nonlinear"]))) == "two-stage"
    assert estimates(fit)[0].columns[2] == "two-stage (used)"
    table = tables.table_iii(fit)
    assert table.columns[3] == "ours, two-stage (used)" and table.columns[5] == "ours, joint"
    assert table.rows[3][3] == tables.number(fit["nonlinear"]["tau2"][0])
    assert table.rows[3][5] == tables.number(fit["nonlinear"]["joint"]["tau2"][0])
    labels = [text.get_text() for text in clutch.polynomials(fit).axes[1].get_legend().get_texts()]
    assert labels == ["two-stage", "joint fit", "joint, sd weights", "published", "single levels"]


def test_hubers_weights_are_shown_for_every_model(fits: dict[str, dict[str, Any]]) -> None:
    found = huber(fits["huber"])
    assert [table.heading.split(", ")[1] for table in found] == ["friction model", "nonlinear model", "linear model"]
    row = fits["huber"]["nonlinear"]["robust"]["weights"][4]
    assert found[1].rows[4][:3] == ("100 %", tables.number(100 * row["below_one"], 2), tables.number(row["mean"], 3))
    assert huber(fits["joint"]) == []


def test_the_recommendation_heads_the_tables_of_adequacy(fits: dict[str, dict[str, Any]]) -> None:
    table = next(table for table in details.adequacy(fits["joint"]) if table.heading == "Is the model right")
    assert table.caption.startswith(f"Recommended: {fits['joint']['uncertainty']['adequacy']['recommended']}.")
    assert [row[0] for row in table.rows[:5]] == ["20 %", "40 %", "60 %", "80 %", "100 %"]


def test_an_interval_that_is_none_says_why_and_how_they_were_found() -> None:
    word = "not determined: 4.1 or anything above"
    row = {"level": 150.0, "Ts": 0.1, "tau1": 0.01, "tau2": 9.0, "ci95": {"Ts": [0.09, 0.11], "tau2": None}}
    fit = {
        "data": {"kind": "clutch", "input_unit": "", "output_unit": "N"},
        "friction": {"levels": [{**row, "words": {"tau2": word}}]},
        "uncertainty": {"ci": "profile", "means": "by the profile of their cost", "why": "one run a level: the curve"},
    }
    table = tables.levels_table(fit)
    assert table.columns[:2] == ("level", "T_s (N)") and table.rows[0][6] == word
    assert "profile, by the profile of their cost. One run a level: the curve." in table.caption


def test_the_live_band_is_mean_plus_and_minus_sd() -> None:
    import numpy as np

    t = np.linspace(0, 1, 50)
    plot = live.steps([("10 %", t, t)], [None], "Torque", "N·m", [np.full(50, 0.5)])
    text = str(plot["doc"])
    assert "VArea" in text and "VArea" not in str(live.steps([("10 %", t, t)], [None], "Torque", "N·m")["doc"])


def test_levels_without_a_unit_have_no_empty_brackets() -> None:
    from eaid.report.figures.steps import level_text, quantity

    assert level_text(300.0, "") == "300" and level_text(40.0, "%") == "40 %"
    assert quantity("") == "Output" and quantity("N") == "Force (N)"
