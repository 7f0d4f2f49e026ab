"""300 levels: a report within its time, whose page stays short."""

import re
import time
from pathlib import Path

import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT
from eaid.report.page.parts import OPEN_ROWS, opened
from eaid.report.tables.table import Table, columns
from eaid.report.write import write_report
from eaid.results.fit import Bounds, Fit, Friction, FrictionLevel, Linear, Nonlinear
from eaid.steps.stepset import Level, StepSet


def test_a_long_table_shows_some_rows_and_folds_them_all():
    table = Table("Levels", "All.", columns("level"), tuple((k,) for k in range(300)))
    (shown,), (fold,) = opened([table])
    assert len(shown.rows) == OPEN_ROWS and (shown.rows[0], shown.rows[-1]) == ((0,), (299,))
    assert "24 of 300 rows" in shown.caption and fold.tables == (table,)
    assert opened([Table("x", "", columns("level"), ((1,),))])[1] == ()


@pytest.mark.slow
def test_three_hundred_levels_in_twenty_seconds(tmp_path: Path):
    t = np.linspace(0, 10, 1001)
    p = REFERENCE_PLANT
    random = np.random.default_rng(0)
    levels = tuple(
        Level(u, t, nonlinear.step_response(p, t, u) + 0.01 * random.standard_normal((2, len(t))), ("a", "b"))
        for u in np.linspace(10, 100, 300).tolist()
    )
    rows = tuple(FrictionLevel(one.level, *_curve(one.level), rmse=0.01) for one in levels)
    fit = Fit(
        friction=Friction(0.85, levels=rows),
        nonlinear=Nonlinear(p.tau1, p.tau2, p.Ts, (10.0, 100.0)),
        linear=Linear(1.84, 0.0783, -1.34, bounds=Bounds(B_m=8.3, B_M=41.1)),
    )
    begun = time.process_time()
    made = write_report([StepSet("clutch", "%", "N·m", Apparatus(), levels), fit], tmp_path / "out")
    assert time.process_time() - begun < 20
    text = made.page.read_text(encoding="utf-8")
    shown = re.sub(r"<details.*?</details>", "", text, flags=re.DOTALL)
    assert made.page.stat().st_size < 4e6 and shown.count("<tr>") <= 3 * (OPEN_ROWS + 1)
    assert text.count("<tr>") > 300 and "fig07_nonlinear_model" in made.figures


def _curve(u: float) -> tuple[float, float, float]:
    one = nonlinear.at_duty(REFERENCE_PLANT, u)
    return one.Ts, one.tau1, one.tau2


@pytest.mark.parametrize("count", [1, 14, 15])
def test_many_levels_have_a_colour_bar_and_few_their_names(count: int):
    from eaid.report import style
    from eaid.report.figures.steps import draw_steps

    t = np.linspace(0, 1, 20)
    rows = tuple(Level(float(k + 1), t, k * t[None], ("a",)) for k in range(count))
    figure, (axes,) = style.column(3)
    draw_steps(axes, StepSet("clutch", "%", "N·m", Apparatus(), rows), {})
    names = [text.get_text() for text in axes.texts]
    assert len(names) == (count if count <= 14 else 0) and len(figure.axes) == (1 if count <= 14 else 2)
