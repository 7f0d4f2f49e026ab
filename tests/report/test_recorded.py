"""The page of logs fitted as recorded, and thinned curves."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eaid.report.panels import thinned


@pytest.fixture(scope="module")
def told(recorded):
    return json.loads(recorded.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def logs(recorded, report):
    return report(recorded)


def test_logs_as_recorded_are_on_the_page(logs):
    model = logs.html.split('<section id="model">')[1].split("</section>")[0]
    assert model.index('id="recorded_logs"') < model.index("<h3>Logs fitted as recorded</h3>") < model.index("<details")
    assert "4 logs as recorded, 159.9 s" in logs.chips
    assert logs.html.count('class="picture"') == 2 and "three are drawn" in logs.captions["recorded_logs"]


def test_its_tables_say_what_the_fit_says(logs, told):
    def close(shown, wanted):
        numbers = [np.nan if text == "–" else float(text.replace("−", "-")) for text in shown]
        return numbers == pytest.approx([np.nan if x is None else x for x in wanted], rel=0.05, nan_ok=True)

    known = told["recorded"]
    rows = logs.rows("Logs fitted as recorded")
    assert close([row[-4] for row in rows], [one["fit_pct"] for one in known["logs"]])
    assert close([row[-3] for row in rows], [one["one_step_pct"] for one in known["logs"]])
    assert close([row[5] for row in logs.rows("Closed loops as recorded")], [known["loops"][0]["rms_error"]])
    low, high = told["nonlinear"]["curves"][-1]["ci95"]["tau1"]
    assert f"({low:.3g} … {high:.3g})" in logs.numbers["Values with 95 % intervals"][-1][2]


@given(st.integers(2, 5000), st.integers(4, 200), st.integers(0, 2**32 - 1))
def test_thinned_curves_keep_ends_and_extremes_in_order(n, points, seed):
    y = np.random.default_rng(seed).normal(size=n)
    t, few = thinned(np.arange(float(n)), y, points)
    assert t[0] == 0 and t[-1] == n - 1 and np.all(np.diff(t) > 0) and np.array_equal(y[t.astype(int)], few)
    assert few.max() == y.max() and few.min() == y.min() and len(few) <= max(points, 2) + 4


def test_rows_that_are_not_compared_are_a_gap_of_the_lines():
    """A straight line was drawn across the rows that an output's limit left out, as if it had been measured."""
    from eaid.report.figures.replays import broken_at_gaps

    t = np.delete(np.arange(1000) * 0.1, np.arange(300, 400))
    at, values = broken_at_gaps(t, np.sin(t)[None])
    assert np.isnan(at).sum() == 1 and np.isnan(values[300]) and len(at) == 901
    few = np.arange(20.0)
    assert not np.isnan(broken_at_gaps(few, few[None])).any()
