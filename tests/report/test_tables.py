import math

import pytest

from eaid.report import tables
from eaid.report.details import guarantee, margins
from eaid.report.tables import formula, interval, number


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (1.84393, 4, "1.844"),
        (-2.42, 3, "−2.42"),
        (0, 4, "0"),
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
    assert interval([1.0, 2.5]) == "1.00 … 2.50"
    assert interval([None, 2.5]) == "–"
    assert interval(None) == "–"


def test_formulas_by_their_form():
    assert formula({"form": "linear", "coefficients": [0.0944, -0.0896]}, "σ") == "0.09440 σ − 0.08960"
    merged = {"form": "merged-exponential", "coefficients": [5.4, 0.1, -0.0101]}
    assert formula(merged, "Ω") == "(5.400 + 0.1000 Ω) e^(−0.01010 Ω)"
    double = {"form": "double-exponential", "coefficients": [6.01, -0.431, -0.11, 0.0492]}
    assert formula(double, "σ") == "6.010 e^(−0.4310 σ) − 0.1100 e^(0.04920 σ)"


def test_table_iii_puts_the_published_value_beside_ours():
    part = {"C": 0.85, "tau1": [0.007, 0.024, -2e-4], "tau2": [1, 0.4, -3e-3], "Ts": [0.03, 0.01, 2e-4, 1e-6]}
    fit = {"nonlinear": {**part, "ci95": {"tau1": [[0.005, 0.009], [0.02, 0.03], [None, None]]}}}
    table = tables.table_iii(fit)
    assert table.heading == "Table III"
    assert table.rows[0] == ("a_0", "τ1, constant", "0.00674", "0.007000", "0.00500 … 0.00900", "s")
    assert table.rows[2][4] == "–"
    assert [row[0] for row in table.rows] == ["a_0", "a_1", "a_2", "b_0", "b_1", "b_2", "c_0", "c_1", "c_2", "c_3", "C"]


def test_table_iv_and_the_linear_model():
    rows = {row[0]: row for row in tables.table_iv({"rc": {"B_m": 8.6, "B_M": 41.4, "phi": 0.1}}).rows}
    assert rows["B_m"][1:3] == ("12.4", "8.600")
    assert rows["φ"][1:3] == ("0.0500", "0.1000")
    assert rows["K_P"][1:3] == ("4.50", "–")  # absent in the file: a dash, no failure
    linear = tables.linear_table({"linear": {"a0": 1.8, "b0": 0.078, "c0": -1.3, "ci95": {"a0": [1.7, 1.9]}}})
    assert linear.rows[0] == ("a0", "1.36", "1.800", "1.70 … 1.90", "1/s")


def test_what_is_absent_costs_only_its_table():
    assert guarantee({"rc": {}}) == []
    assert margins({}) == []
    assert tables.gains_table({}).rows[0][2] == "–"
