"""Figures of results: their letters and units, and what is drawn of numbers that are known."""

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

import eaid
from eaid.report.figures import CATALOGUE
from eaid.report.panels import COLUMN_IN, Axis, Line, Panel, Sheet
from eaid.report.paper import figure_of, look
from eaid.report.results import gathered

from ..conftest import PLANT, loaded

T = np.linspace(0, 20, 401)


def drawn(name, *results):
    """A figure of the catalogue with its words; None where its data were not given."""
    (row,) = [one for one in CATALOGUE if one.name == name]
    sheet = row.sheet(gathered(results))
    with look():
        return sheet and SimpleNamespace(figure=figure_of(sheet), sees=row.sees, title=row.title)


def response(u, t=T):
    """Eqs. (4)–(7) of that plant."""
    tau1, tau2, steady = (np.polynomial.polynomial.polyval(u, PLANT[key]) for key in ("tau1", "tau2", "Ts"))
    return steady * (1 - 0.85 * np.exp(-t / tau1) - 0.15 * np.exp(-t / tau2))


def steps_of(outputs, t=T):
    """Steps from rest after two seconds."""
    idle = np.arange(-2, 0, t[1])
    frames = {
        f"run-{u:g}": pd.DataFrame({
            "time_s": np.concatenate([idle, t]) + 2, "duty_pct": np.where(np.concatenate([idle, t]) < -1e-9, 0.0, u),
            "torque_nm": np.concatenate([0 * idle, y]),
        })
        for u, y in outputs.items()
    }  # fmt: skip
    return eaid.read(frames)


def fit_of(**parts):
    """A fit as a script may write it."""
    return loaded({"schema": "eaid/fit/2", **parts})


@pytest.fixture(scope="module")
def given(files, others, tmp_path_factory):
    """Results that together show every figure."""
    fit, gains = eaid.load(files["clutch.json"]), eaid.load(files["gains.json"])
    reference = pd.DataFrame({"time_s": [0.0, 1.0, 3.0], "reference_nm": [0.0, 1.0, 1.0]})
    reference.to_csv(path := tmp_path_factory.mktemp("own") / "mine.csv", index=False)
    more = [eaid.simulate(fit, gains, log=files["clutch.h5"]), eaid.simulate(fit, gains, reference=path)]
    return [
        [*map(eaid.load, files.values()), *more],
        *([eaid.load(path) for path in others[name]] for name in ("recorded", "staircase")),
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", [row.name for row in CATALOGUE if not row.name.startswith("sessions")])
def test_letters_are_whole_units_are_named_and_widths_are_a_journals(name, given):
    ready = next(filter(None, (drawn(name, *results) for results in given)))
    figure = ready.figure
    with look():
        figure.canvas.draw()
    assert figure.get_figwidth() in (3.5, 7.16) and ready.sees.endswith(".") and ready.title
    for label in (text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel()) if text):
        assert "(" in label and label.rstrip().endswith(")"), label
    shown = [one for one in figure.findobj(Text) if one.get_visible() and one.get_text().strip()]
    assert min(one.get_fontsize() for one in shown) >= 8
    width, height = figure.get_size_inches() * figure.dpi
    ticks = re.compile(r"[−\d.e$^{}×-]+|[$].mathdefault.*|resistive.*|assisted")  # beyond the limits not drawn
    for one in shown:
        if not ticks.fullmatch(one.get_text()) and (one.axes is None or one.axes.get_visible()):
            box = one.get_window_extent()
            assert box.x0 > -1 and box.x1 < width + 1 and box.y0 > -1 and box.y1 < height + 1, one.get_text()
    panels = [axes for axes in figure.axes if axes.get_visible()]
    for axes in panels:
        if (legend := axes.get_legend()) is not None:
            box, plot = legend.get_window_extent(), axes.get_window_extent()
            assert box.y0 >= plot.y1 - 1 or box.x0 >= plot.x1 - 1  # off the data
    if len(panels) > 1:
        assert [axes.get_title("left")[:3] for axes in panels] == [f"({mark})" for mark in "abcdefghi"[: len(panels)]]


def test_lost_and_left_by_hand():
    """A drive that peaks at 2, is held at 1.5 in the end and keeps 0.3 afterwards: 25 % lost, 20 % left."""
    t = np.arange(-2, 20, 0.01)
    torque = np.select([t < 0, t < 5, t < 10], [0.0, 2.0, 1.5], 0.3)
    frame = pd.DataFrame({"time_s": t + 2, "duty_pct": np.where((t < 0) | (t > 10), 0.0, 50.0), "torque_nm": torque})
    ready = drawn("fig06_hold_and_release", eaid.read({"a": frame}))
    assert ready.figure.axes[0].lines[0].get_label() == "50 %: lost 25.0 %, left 20.0 %"


def test_shear_point_by_hand():
    """4.372 N·m over 2·2π(0.06³ − 0.04³)/3 = 6.367e-4 m³ is 6.867 kPa; 300 V over 95 µm is 3.158 V/µm."""
    ready = drawn("fig09_shear_per_field", fit_of(nonlinear=PLANT))
    ((field,), (stress,)) = ready.figure.axes[0].lines[-1].get_data()
    assert field == pytest.approx(3.1579, rel=1e-4) and stress == pytest.approx(4.372 / 6.36696e-4 / 1e3, rel=1e-4)
    assert ready.figure.axes[0].texts[-1].get_text() == "this clutch,\n6.87 kPa\nat 3.16 V/µm"


def test_the_model_is_drawn_through_its_levels_and_a_curve_that_only_crosses_the_axis_is_not():
    """τ2 = (u − 60)²·1e5 + 5, millions of seconds but about one input: no vertical line."""
    levels = [{"level": u, "Ts": response(u)[-1], "tau1": 0.5, "tau2": 5.0} for u in (20.0, 60.0, 100.0)]
    far = {**PLANT, "tau2": [3.6e8 + 5, -1.2e7, 1e5]}
    tau1, tau2 = drawn("model_over_duty", fit_of(nonlinear=far, friction={"C": 0.85, "levels": levels})).figure.axes[1:]
    assert np.isnan(tau2.lines[0].get_ydata()).all() and tau2.get_ylim()[1] == pytest.approx(1.1 * 5)
    x, y = tau1.lines[0].get_data()
    assert y == pytest.approx(np.polynomial.polynomial.polyval(x, PLANT["tau1"]))
    assert {line.get_label() for line in tau1.lines} >= {"model", "published"}


def test_the_linear_model_is_not_drawn_below_zero():
    """At 20 % it ends at (0.0783·20 − 1.34)/1.84 = 0.12 N·m; with c0 = −2 below zero."""
    steps = steps_of({u: response(u) for u in (20.0, 60.0, 100.0)})
    for c0, count in ((-1.34, 3), (-2.0, 2)):
        ready = drawn("fig08_linear_model", steps, fit_of(linear={"a0": 1.84, "b0": 0.0783, "c0": c0}))
        lines = [line.get_ydata() for line in ready.figure.axes[0].lines if len(line.get_xdata())]
        assert len(lines) == 3 + count
    last = lines[-1][-1]
    assert last == pytest.approx((0.0783 * 100 - 2) / 1.84, rel=1e-6)


@pytest.mark.parametrize("unit", ["N", "N·m"])
def test_friction_over_stress_has_a_coefficient_of_friction_where_the_output_is_a_torque(unit):
    """C_f = 3 T_s/(2π σ (r2³ − r1³)) of one surface, Eq. (1): 10 kPa and 1 N·m of the usual rig give 0.3142."""
    ends = {"Ts": [0.9, 1.1], "tau1": None, "tau2": None}
    rows = [
        {"level": 5.0 * k, "Ts": 1.0, "tau1": 0.1, "tau2": 5.0, "stress_kpa": 10.0 * k, "ci95": ends} for k in (1, 2, 3)
    ]
    trend = {"form": "linear", "over": "stress_kpa", "coefficients": [0.5, -0.1]}
    fit = fit_of(data={"kind": "friction-force", "input_unit": "N", "output_unit": unit, "apparatus": {"surfaces": 1}},
                 friction={"C": 0.85, "over": "stress_kpa", "levels": rows, "trends": {"Ts": trend}})  # fmt: skip
    axes = drawn("fig04_friction_over_stress", fit).figure.axes
    assert len(axes) == 3 + (unit == "N·m")
    x, y = axes[0].lines[0].get_data()
    assert y == pytest.approx(0.5 * x - 0.1)
    if unit == "N·m":
        volume = 2 * np.pi * (0.06**3 - 0.04**3) / 3
        values = axes[2].containers[0].lines[0].get_ydata()
        assert values == pytest.approx([1 / (1e4 * k * volume) for k in (1, 2, 3)])


@pytest.mark.parametrize("count", [14, 30])
def test_of_many_levels_some_are_named_and_the_table_is_folded(count, tmp_path):
    steps = eaid.synth(levels=tuple(np.linspace(10, 100, count)), repeats=1, rate_hz=10.0, hold_s=5.0, clean=True)
    figure = drawn("fig07_nonlinear_model", steps).figure
    assert [one.get_text() for one in figure.axes[0].texts][::13] == ["10 %", "100 %"]
    html = eaid.report(steps, tmp_path / "out", figures=("fig02",)).read_text(encoding="utf-8")
    shown = re.sub(r"<details.*?</details>", "", html, flags=re.DOTALL)
    assert shown.count("<tr>") == (15 if count == 14 else 0)  # a longer table stands folded
    assert f'<th scope="row">{10 + 90 / (count - 1):.4g}</th>' in html


@pytest.mark.slow
def test_a_step_is_drawn_with_the_curve_that_was_fitted_to_it(others):
    fit, steps = map(eaid.load, others["staircase"])
    ready = drawn("level_steps", fit, steps)
    lines = [line.get_ydata() for line in ready.figure.axes[0].lines if len(line.get_xdata()) > 2]
    half = len(lines) // 2  # the models are drawn above all that was measured
    shown = list(zip(lines[:half], lines[half:], strict=True))
    apart = [np.mean(measured[-40:]) - model[-1] for measured, model in shown]
    size = max(abs(model[-1]) for _measured, model in shown)
    assert np.max(np.abs(apart)) < 0.05 * size and len(shown) == min(len(fit.steps), 12)


def test_walls_have_their_table(files, tmp_path, report):
    coupling = eaid.couple(eaid.load(files["clutch.json"]), eaid.load(files["gains.json"]), torque=(1.0,), replay=False)
    coupling.save(tmp_path / "couple.json")
    page = report(files["clutch.json"], tmp_path / "couple.json", "--figures", "fig02")
    rows = page.rows("How stiff a virtual wall may be")
    assert [float(row[2]) for row in rows] == pytest.approx([wall.K_passive for wall in coupling.walls], rel=0.01)


def test_plot_of_a_fit_has_a_line_a_level_and_of_a_replay_its_reference(files):
    fit, replay = eaid.load(files["clutch.json"]), eaid.load(files["steps.h5"])
    ax = fit.plot()
    assert ax.get_ylabel() == "Torque (N·m)" and fit.plot(ax=ax) is ax
    assert [line.get_label() for line in ax.lines][:5] == [f"{u:g} %" for u in fit.data.levels]
    assert ax.lines[4].get_ydata()[-1] == pytest.approx(fit.nonlinear.curves[-1].Ts, rel=0.05)
    gains = eaid.load(files["gains.json"])
    drawn = {line.get_label(): line.get_ydata().tolist() for line in gains.plot().lines}
    points = gains.margins.points
    assert drawn == {name.upper(): [one.loops[name].gain_db for one in points] for name in ("rc", "pi")}
    ax = replay.plot()
    *traces, reference = ax.lines
    assert {line.get_label() for line in traces} == {"RC", "PI"} and reference.get_label() == "reference"
    assert np.max(reference.get_ydata()) == pytest.approx(np.max(replay.records["rc"].columns["reference_nm"]))


@pytest.mark.parametrize("names", [("RC", "PI"), ("RC", "PI", "PI with RC's feedforward")])
def test_names_above_a_panel_leave_its_letter_free(names):
    """Three controllers of a sweep stood on the letter of their panel."""
    lines = [Line([0, 1], [0, k], name, marker="o") for k, name in enumerate(names)]
    panel = Panel(Axis("Frequency", "Hz"), Axis("Amplitude", "dB"), lines, legend="above", columns=3)
    with look():
        figure = figure_of(Sheet([panel, panel], 3.3, COLUMN_IN))
        figure.canvas.draw()
    letters = [one.get_window_extent() for one in figure.findobj(Text) if one.get_text().strip() in ("(a)", "(b)")]
    shown = [axes.get_legend().get_window_extent() for axes in figure.axes]
    assert len(letters) == 2 and not any(one.overlaps(other) for one in letters for other in shown)
