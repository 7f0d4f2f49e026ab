"""Trends: curves, gradients against complex steps."""

import numpy as np
import pytest

from eaid.models.trends import FORMS, evaluate

X = np.linspace(2.7, 27.0, 10)
EXAMPLES = {
    "linear": np.array([0.0944, -0.0896]),
    "double-exponential": np.array([6.01, -0.431, 0.11, 0.0492]),
    "merged-exponential": np.array([1.5, 0.4, -0.05]),
}


def test_every_form_has_an_example_here() -> None:
    assert EXAMPLES.keys() == FORMS.keys()
    assert all(len(EXAMPLES[name]) == len(form.coefficients) for name, form in FORMS.items())


def test_table_one_at_its_ends() -> None:
    assert evaluate("double-exponential", (6.01, -0.431, 0.11, 0.0492), np.array([2.7]))[0] == pytest.approx(
        2.003, abs=1e-3
    )
    assert evaluate("linear", (0.0944, -0.0896), np.array([27.0]))[0] == pytest.approx(2.4592)


@pytest.mark.parametrize("name", FORMS)
def test_gradient(name: str) -> None:
    form, c = FORMS[name], EXAMPLES[name]
    for k in range(len(c)):
        shifted = c.astype(complex)
        shifted[k] += 1e-30j
        want = form.curve(shifted, X).imag / 1e-30
        assert form.gradient(c, X)[k] == pytest.approx(want, rel=1e-12)


def test_merged_is_the_limit_of_the_pair() -> None:
    rate, gap = -0.05, 1e-6
    pair = np.array([0.5 * (1.5 + 0.4 / gap), rate + gap, 0.5 * (1.5 - 0.4 / gap), rate - gap])
    assert FORMS["double-exponential"].curve(pair, X) == pytest.approx(
        FORMS["merged-exponential"].curve(np.array([1.5, 0.4, rate]), X), rel=1e-7
    )
