"""Lights, tiles, chips and what to do next: by codes, severities and numbers, never by words."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eaid.findings import Finding, finding
from eaid.report.figures import clutch as frictions
from eaid.report.figures import values
from eaid.report.page import summary
from eaid.report.page.known import known, sentence
from eaid.report.page.next_steps import next_steps
from eaid.report.results import Results, gathered
from eaid.results import fit as results
from eaid.results.common import Source
from eaid.results.fit import Fit, Friction, FrictionLevel, LevelIntervals, Linear
from eaid.results.gains import Condition, Gains, Guarantee, LinearModel, Margin, Margins, WorstMargins

CLEAN: dict[str, Any] = {"linear": Linear(1.8, 0.08, -1.3), "converged": True}


def found(severity: str, subject: str = "nonlinear", **values: Any) -> Finding:
    return Finding(f"test-{severity}", severity, subject, values=values)  # type: ignore[arg-type]


def grades(given: Results) -> list[str]:
    return [light.grade for light in summary.lights(given, known(given))]


def test_a_clean_fit_is_good_and_what_is_not_given_has_no_light():
    fit = Fit(data=results.FittedData(sources=(Source(run="a", level=10.0),)), **CLEAN)
    assert grades(gathered([fit])) == ["good", "good", "none"]


@pytest.mark.parametrize(
    ("severity", "subject", "wanted"),
    [
        ("stop", "nonlinear", ["none", "bad", "none"]),
        ("caution", "linear", ["none", "care", "none"]),
        ("note", "release", ["none", "good", "none"]),
    ],
)
def test_a_light_is_as_grave_as_its_gravest_finding(severity: str, subject: str, wanted: list[str]):
    assert grades(gathered([Fit(**CLEAN, findings=(found(severity, subject), found("note")))])) == wanted


def test_a_finding_about_the_data_is_of_the_data():
    fit = Fit(data=results.FittedData(sources=(Source(run="a"),)), **CLEAN, findings=(found("stop", "a"),))
    assert grades(gathered([fit])) == ["bad", "good", "none"]


def test_a_fit_that_did_not_converge_is_a_stop():
    assert grades(gathered([Fit(linear=CLEAN["linear"], converged=False)]))[1] == "bad"


@pytest.mark.parametrize(
    ("holds", "words", "grade"),
    [
        ((True, True), "yes", "good"),
        ((False, True), "NO (φ)", "care"),
        ((False, False), "NO (φ, duty limit)", "care"),
        ((True, None), "not known (duty limit)", "good"),
    ],
)
def test_one_verdict_on_the_guarantee(holds: tuple[bool | None, bool | None], words: str, grade: str):
    rows = tuple(Condition(name, one) for name, one in zip(("phi", "duty-limit"), holds, strict=True))
    whole = False if False in holds else None if None in holds else True
    gains = Gains(LinearModel(1.0, 1.0, 0.0), guarantee=Guarantee(whole, rows))
    given = gathered([gains])
    light = summary.lights(given, known(given))[2]
    assert (light.grade, light.text) == (grade, f"guarantee {words}")


def test_what_to_do_next_follows_what_is_missing():
    fit = Fit(**CLEAN)
    assert [step.command.split()[1] for step in next_steps(gathered([fit]), known(gathered([fit])))] == ["tune-rc"]
    gains = Gains(LinearModel(1.0, 1.0, 0.0), guarantee=Guarantee(False, (Condition("phi", False),)))
    given = gathered([fit, gains])
    steps = next_steps(given, known(given))
    assert [step.command.split()[1] for step in steps] == ["tune-rc", "simulate", "export"]
    assert "--phi data" in steps[0].command and "--alpha" not in steps[0].command
    assert next_steps(gathered([]), known(gathered([]))) == ()


def test_tiles_are_the_top_level_and_the_worst_margin():
    ends = LevelIntervals(Ts=(1.9, 2.1))
    levels = (
        FrictionLevel(10.0, 1.0, 0.1, 5.0),
        FrictionLevel(300.0, 2.0, 0.2, 6.0, ci95=ends),
    )
    data = results.FittedData("clutch", "V", "N")
    worst = WorstMargins(Margin(gain_db=16.2, phase_deg=78.1), Margin(gain_db=42.7, phase_deg=31.5))
    gains = Gains(LinearModel(1.0, 1.0, 0.0), margins=Margins(worst=worst))
    shown = summary.tiles(gathered([Fit(data=data, friction=Friction(0.85, levels=levels)), gains]))
    assert len(shown) == 6
    assert (shown[1].label, shown[1].value) == ("T_s at 300 V", "2.00 N") and shown[1].note.startswith("1.90 … 2.10")
    assert (shown[5].value, shown[5].note) == ("78° | 32°", "phase; gain 16 | 43 dB")


def test_a_time_constant_without_end_has_no_number():
    levels = (FrictionLevel(10.0, 1.0, 0.1, 5.0), FrictionLevel(20.0, 2.0, 0.2, 2.9e7))
    shown = summary.tiles(
        gathered([Fit(data=results.FittedData("clutch", "V", "N"), friction=Friction(0.85, levels=levels))])
    )
    assert (shown[2].value, shown[3].value) == ("0.200 s", "not estimable")
    drawn = values.values_of(levels, "tau2")
    assert drawn[0] == 5 and np.isnan(drawn[1]) and values.highest(drawn) == 5


def test_chips_name_units_and_levels():
    chips = summary.chips(gathered([Fit(data=results.FittedData("clutch", "V", "N", (100.0, 300.0)))]))
    assert chips == ("V → N", "2 levels, 100 to 300 V")


@pytest.mark.parametrize(("units", "title"), [(("%", "N·m"), "Electroadhesive clutch"), (("V", "N"), "Step responses")])
def test_only_such_a_clutch_is_called_one(units: tuple[str, str], title: str):
    given = gathered([Fit(data=results.FittedData("clutch", *units))])
    assert summary.title(given) == title and summary.title(replace(given, paper=True)) == "Electroadhesive clutch"


def test_a_sentence_has_a_capital_and_a_stop():
    said = sentence(finding("part-left-out", "nonlinear", part="linear", key="a0"))
    assert said == "Nonlinear model: nonlinear: its linear has no a0 and is left out."
    assert sentence(Finding("test", "caution", "run-3"), of_data=True) == "run-3: test."
    assert sentence(Finding("test", "caution", "rc")) == "Test."


def test_a_run_whose_shape_the_model_misses_is_the_models_matter():
    fit = Fit(**CLEAN, findings=(finding("shape-misses", "run-1", (5.0,), worst=1.0, share_pct=20.0),))
    assert grades(gathered([fit]))[1] == "care"


def test_a_friction_coefficient_that_was_not_computed_is_not_drawn():
    ends = LevelIntervals(Ts=(1.9, 2.1))
    rows = [FrictionLevel(x, x, 0.1, 5.0, ci95=ends, stress_kpa=100 * x) for x in (1.0, 3.0, 5.0)]
    for unit, panels in (("N", 3), ("N·m", 4)):
        part = Friction(0.85, levels=tuple(rows), over="stress_kpa")
        fit = Fit(data=results.FittedData("friction-force", "bar", unit), friction=part)
        assert len(frictions.friction_over_stress(fit).axes) == panels
