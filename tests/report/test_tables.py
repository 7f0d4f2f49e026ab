import math

import pytest

from eaid.apparatus import Apparatus
from eaid.findings import Finding
from eaid.report.rig import overlaid
from eaid.report.tables import data, fits, gains
from eaid.report.tables.table import Name, Table, columns, interval, number
from eaid.results import fit as results
from eaid.results.fit import (
    CoefficientIntervals,
    Estimate,
    Fit,
    Friction,
    FrictionLevel,
    LevelIntervals,
    Linear,
    LinearLevel,
    Nonlinear,
    Trend,
)
from eaid.results.gains import Condition, Gains, Guarantee, LinearModel, Rho, Robust
from eaid.steps.stepset import RunRecord, StepSet


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (1.84393, 4, "1.844"),
        (-2.42, 3, "−2.42"),
        (0, 4, "0"),
        (0.0, 4, "0"),
        (21, 4, "21"),
        (-3, 1, "−3"),
        (1.85e-7, 3, "1.85e−7"),
        (5.375e5, 4, "5.375e5"),
        (0.0782825, 4, "0.07828"),
        (99999.0, 3, "99999"),
        (None, 4, "–"),
        (math.nan, 4, "–"),
        (True, 4, "yes"),
        ("text", 4, "–"),
    ],
)
def test_numbers_as_text(value: object, digits: int, text: str):
    assert number(value, digits) == text


def test_intervals_as_text():
    assert interval((1.0, 2.5)) == "1.00 … 2.50"
    assert interval(None) == "–"


def test_a_table_knows_its_heads_texts_and_numbers():
    table = Table(
        "x", "", columns("name", ("τ1", "s", 3), "95 %"), (("a", 0.12345, (1.0, 2.0)), (Name("b"), None, None))
    )
    assert table.heads == ("name", "τ1 (s)", "95 %")
    assert table.texts == (("a", "0.123", "1.00 … 2.00"), ("b", "–", "–"))
    assert table.numeric == (False, True, False)


def test_formulas_by_their_form():
    assert fits.formula(Trend("linear", (0.0944, -0.0896)), "σ") == "0.09440 σ − 0.08960"
    merged = Trend("merged-exponential", (5.4, 0.1, -0.0101))
    assert fits.formula(merged, "Ω") == "(5.400 + 0.1000 Ω) e^(−0.01010 Ω)"
    double = Trend("double-exponential", (6.01, -0.431, -0.11, 0.0492))
    assert fits.formula(double, "σ") == "6.010 e^(−0.4310 σ) − 0.1100 e^(0.04920 σ)"


NONLINEAR = Nonlinear(
    (0.007, 0.024, -2e-4), (1.0, 0.4, -3e-3), (0.03, 0.01, 2e-4, 1e-6), (10.0, 100.0),
    ci95=CoefficientIntervals(tau1=((0.005, 0.009), (0.02, 0.03), None)),
)  # fmt: skip


def test_table_iii_puts_the_published_value_beside_ours():
    table = fits.table_iii(Fit(nonlinear=NONLINEAR))
    assert table.heading == "Table III"
    assert table.texts[0] == ("a_0", "τ1", "0.00674", "0.007000", "0.00500 … 0.00900", "s")
    assert table.texts[2][4] == "–"
    assert [row[0] for row in table.rows] == ["a_0", "a_1", "a_2", "b_0", "b_1", "b_2", "c_0", "c_1", "c_2", "c_3", "C"]


def test_the_estimate_that_is_used_leads_and_the_other_stands_beside_it():
    other = Estimate((0.1, 0.0, 0.0), (2.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (10.0, 100.0))
    part = Nonlinear(NONLINEAR.tau1, NONLINEAR.tau2, NONLINEAR.Ts, (10.0, 100.0), estimator="two-stage", joint=other)
    heads = fits.table_iii(Fit(nonlinear=part)).heads
    assert heads[3] == "ours, two-stage (used)" and heads[5] == "ours, joint"
    assert fits.table_iii(Fit(nonlinear=part)).rows[3][5] == 2.0


def test_another_rig_has_its_own_units_and_no_published_column():
    volts = results.FittedData("clutch", "V", "N")
    linear = Linear(1.8, 0.078, -1.3, per_level=(LinearLevel(100.0, 1.0, 2.0, B=3.0),))
    fit = Fit(data=volts, nonlinear=NONLINEAR, linear=linear)
    for table in (fits.table_iii(fit), fits.linear_table(fit), fits.input_gain_table(fit)):
        assert not any("published" in text.lower() for text in (*table.heads, table.caption)), table.heading
    assert [row[-1] for row in fits.linear_table(fit).rows][:3] == ["1/s", "N/(s·V)", "N/s"]
    assert "B (V·s/(N))" in fits.input_gain_table(fit).heads
    assert "published (%, N·m)" in fits.linear_table(fit, asked=True).heads
    assert fits.linear_table(Fit(linear=linear)).texts[0] == ("a0", "1.36", "1.800", "–", "1/s")


RC = Robust(4.5, 3.0, 12.8, Rho(15.5, 10.3), 0.5, 50.0, ((1.0, 0.5), (0.5, 1.0)), B_m=8.6, B_M=41.4, phi=0.1)
CONDITIONS = (
    Condition("phi", False, 37.5, 17.8, "%"),
    Condition("Q_M", None, None, 5.0, "N·m/s"),
    Condition("rho", True),
)


def test_published_values_that_are_asked_for_beside_other_units_say_their_own():
    fit = Fit(data=results.FittedData("clutch", "V", "N"), nonlinear=NONLINEAR, linear=Linear(1.8, 0.03, -1.3))
    heads = [fits.table_iii(fit, True).heads[2], fits.linear_table(fit, True).heads[1]]
    gain = Gains(LinearModel(1.0, 1.0, 0.0), input_unit="V", output_unit="N")
    heads += [gains.table_iv(gain, True).heads[1], gains.gains_table(gain, True).heads[1]]
    assert heads == ["published (%, N·m)"] * 4
    assert "published" not in " ".join(fits.table_iii(fit, None).heads + gains.table_iv(gain, None).heads)
    assert overlaid(Fit().data) and overlaid(Fit().data, True) and not overlaid(fit.data, True)


def test_only_a_duty_has_a_duty_limit():
    assert gains.called(Condition("duty-limit", False, unit="%")) == "duty limit"
    assert gains.called(Condition("duty-limit", False, unit="V")) == "input limit"


def test_a_stop_is_told_before_the_doubts_of_its_run():
    found = (Finding("clipped", "stop", "a"), Finding("drift", "caution", "a"), Finding("said", "note", "a"))
    run = RunRecord("a", "a.csv", "", 10.0, 1, 0.0, 1.0, 100, 10.0, "rising", found)
    doubtful, fine = data.runs_tables(StepSet("clutch", "V", "N", Apparatus(), (), runs=(run,)))
    assert str(doubtful.rows[0][-1]).startswith("stop: ") and str(doubtful.rows[0][-1]).count("; ") == 1
    assert fine.rows == ()


def test_a_run_is_not_named_again_in_its_own_row():
    found = Finding("repeats-disagree", "caution", "a", (10.0,), {"spread_pct": 20.0, "own_pct": -0.3, "unit": "V"})
    run = RunRecord("a", "a.csv", "", 10.0, 1, 0.0, 1.0, 100, 10.0, "rising", (found,))
    assert data.doubts_of(run)[0].endswith("this run by +0 % from the others")


def test_table_iv_and_the_checklist():
    found = Gains(LinearModel(1.8, 0.08, -1.3), RC, guarantee=Guarantee(False, CONDITIONS))
    rows = {row[0]: row for row in gains.table_iv(found).texts}
    assert rows["B_m"][1:3] == ("12.4", "8.600") and rows["φ"][1:3] == ("0.0500", "0.1000")
    assert rows["Q_M"][2] == "–"  # absent in the file: a dash, no failure
    texts = gains.checklist(found).texts
    assert texts[0] == ("φ", "bound on the error of the model's drift term", "37.5", "17.8", "%", "does not hold")
    assert [row[-1] for row in texts] == ["does not hold", "not known", "holds"]
    other = Gains(LinearModel(1.8, 0.08, -1.3), RC, input_unit="V", output_unit="N")
    assert "published" not in gains.table_iv(other).heads and gains.table_iv(other).rows[0][2] == "V·s/(N)"


def test_what_is_absent_costs_only_its_table():
    bare = Gains(LinearModel(1.0, 1.0, 0.0))
    assert gains.checklist(bare).rows == gains.margins_table(bare).rows == gains.gains_table(bare).rows == ()
    fit = Fit(nonlinear=NONLINEAR)
    tables = (fits.estimates_table, fits.lack_of_fit_table, fits.shapes_table, fits.degrees_table)
    assert [table(fit).rows for table in tables] == [()] * 4


def test_an_interval_that_says_nothing_is_a_dash():
    ends = LevelIntervals(Ts=(0.09, 0.11), tau2=None)
    rows = (FrictionLevel(150.0, 0.1, 0.01, 9.0, ci95=ends),)
    table = fits.levels_table(Fit(data=results.FittedData("clutch", "", "N"), friction=Friction(0.85, levels=rows)))
    assert table.heads[:2] == ("level", "T_s (N)") and table.texts[0][1:3] == ("0.1000", "0.0900 … 0.110")
    assert table.texts[0][6] == "–"
