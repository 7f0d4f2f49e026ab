"""Figures as pure functions: what is drawn, its letters, its units."""

import re
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from eaid.apparatus import Apparatus
from eaid.models import friction, nonlinear
from eaid.models.parameters import REFERENCE_PLANT
from eaid.models.parameters import Friction as Curve
from eaid.report import rig, style
from eaid.report.draw import vector_of
from eaid.report.figures import checks, clutch, recorded, rehab, replays, values
from eaid.report.figures import clutch as frictions
from eaid.report.figures import steps as level_steps
from eaid.results import fit as fits
from eaid.results.common import LevelError
from eaid.results.fit import (
    Bounds,
    Fit,
    Friction,
    FrictionLevel,
    LevelIntervals,
    Linear,
    LinearLevel,
    LinearLevelIntervals,
    Nonlinear,
    StepShape,
    Trend,
)
from eaid.results.recorded import LogCurve, LogFit, Response
from eaid.steps.stepset import Level, LevelStep, StepSet

T = np.linspace(0, 20, 401)
LEVELS = (20.0, 60.0, 100.0)
RELEASE = (0.3, 3.0)


def clutch_set(factor: float = 1.0) -> StepSet:
    rows, falls = [], []
    for u in LEVELS:
        y = factor * nonlinear.step_response(REFERENCE_PLANT, T, u)
        spread = np.array([[0.97], [1.0], [1.03]])
        rows.append(Level(u, T, spread * y, ("a", "b", "c")))
        fall = y[-1] * (0.85 * np.exp(-T / RELEASE[0]) + 0.15 * np.exp(-T / RELEASE[1]))
        falls.append(Level(u, T, fall[None], ("a",)))
    return StepSet("clutch", "%", "N·m", Apparatus(), tuple(rows), tuple(falls))


def levels_of(rows: dict[float, Curve], force: bool = False) -> tuple[FrictionLevel, ...]:
    return tuple(
        FrictionLevel(
            u, p.Ts, p.tau1, p.tau2, rmse=0.01, stress_kpa=u / (np.pi * 2e-3) / 1e3 if force else None, speed_rpm=u,
            ci95=LevelIntervals((0.95 * p.Ts, 1.05 * p.Ts), (0.9 * p.tau1, 1.1 * p.tau1), None),
        )
        for u, p in rows.items()
    )  # fmt: skip


def clutch_fit(factor: float = 1.0) -> Fit:
    p = REFERENCE_PLANT
    curves = {u: nonlinear.at_duty(p, u) for u in LEVELS}
    per_level = tuple(LevelError(u, rmse=u / 1000) for u in LEVELS)
    steady = tuple(factor * c for c in p.Ts)
    each = tuple(
        LinearLevel(u, 1.8, u / 40, B=B, ci95=LinearLevelIntervals(B=(0.9 * B, 1.1 * B)))
        for u, B in zip(LEVELS, (36.5, 33.0, 8.3), strict=True)
    )
    return Fit(
        friction=Friction(0.85, levels=levels_of(curves)),
        nonlinear=Nonlinear(p.tau1, p.tau2, steady, (10.0, 100.0), per_level=per_level),
        linear=Linear(1.84, 0.0783, -1.34, bounds=Bounds(B_m=8.3, B_M=41.1), per_level=each),
    )


def friction_fit(kind: str) -> Fit:
    force = kind == "friction-force"
    levels = np.array([17.0, 51.0, 102.0, 170.0]) if force else np.array([5.0, 15.0, 25.0, 40.0])
    x = levels / (np.pi * 2e-3) / 1e3 if force else levels
    curves = rig.OVER_STRESS if force else {**rig.OVER_SPEED, "tau2": lambda w: 5.4 * np.exp(-0.0101 * w)}
    rows = {u: Curve(*(float(curves[k](xi)) for k in ("Ts", "tau1", "tau2"))) for u, xi in zip(levels, x, strict=True)}
    table = rig.TABLE_I if force else {k: rig.TABLE_II[k] for k in ("Ts", "tau1")}
    forms = {2: "linear", 4: "double-exponential"}
    trends = {k: Trend(forms[len(c)], c) for k, (_t, c, _r) in table.items()}
    data = fits.FittedData(kind, "N" if force else "RPM", apparatus=fits.Rig(surfaces=1))
    return Fit(
        data=data,
        friction=Friction(0.85, "stress_kpa" if force else "speed_rpm", levels_of(rows, force), trends),
    )


def force_set() -> StepSet:
    rows = []
    for row in friction_fit("friction-force").friction.levels:
        y = friction.step_response(Curve(row.Ts, row.tau1, row.tau2), T)
        rows.append(Level(row.level, T, 1.02 * y[None], ("a",)))
    return StepSet("friction-force", "N", "N·m", Apparatus(surfaces=1), tuple(rows))


def staircase() -> tuple[StepSet, tuple[StepShape, ...]]:
    shapes = tuple(
        StepShape(
            f"s{k}", 50.0 * k, 50.0 * (k + 1), "up", 1.0 * k, 1.0 / (k + 1), 0.02, "two", 0.3, 4.0, 0.85, 0.5, 0.01,
            95.0, 0.9, 9,
        )
        for k in range(3)
    )  # fmt: skip
    steps = tuple(
        LevelStep(
            one.run, "a.csv", one.from_, one.level, one.start, T, one.predict(T) + 0.05, np.full_like(T, one.level)
        )
        for one in shapes
    )
    return StepSet("clutch", "%", "N·m", Apparatus(), (), level_steps=steps), shapes


def up_and_down() -> tuple[StepShape, ...]:
    _data, up = staircase()
    down = tuple(
        msgspec.structs.replace(one, from_=one.level, level=one.from_, edge="down", gain=0.8 * one.gain, tau2=None)
        for one in up
    )
    return (*up, *down)


def traces() -> dict[str, dict[str, Any]]:
    t = np.linspace(0, 10, 1001)
    reference = 2 + np.sin(t)
    return {
        name: {"time_s": t, "reference_nm": reference, "torque_nm": reference * -np.expm1(-rate * t),
               "duty_pct": 50 + 30 * np.sin(t + rate)}
        for name, rate in (("rc", 5.0), ("pi", 1.0))
    }  # fmt: skip


def robust_term() -> dict[str, Any]:
    t = np.linspace(0, 10, 501)
    return {"time_s": t, "rho_nm_s": 15 + np.sin(t) ** 2, "chi_nm_s": 5 * np.sin(3 * t)}


def tones() -> dict[str, dict[str, Any]]:
    f = np.array([0.2, 0.5, 1.0, 3.0])
    return {
        name: {"frequency_hz": f, "gain_db": -k * f, "mean_abs_error_nm": 0.1 * k * f}
        for name, k in (("rc", 1.0), ("pi", 3.0), ("open-loop", 5.0))
    }


def session() -> tuple[dict[str, Any], list[tuple[str, float, float]]]:
    t = np.linspace(0, 90, 901)
    trace = {"time_s": t, "target_deg": 35 - 25 * np.cos(t), "angle_deg": 35 - 22 * np.cos(t - 0.2),
             "desired_nm": np.sin(t), "rendered_nm": 0.95 * np.sin(t - 0.05)}  # fmt: skip
    return trace, [("soft", 0.0, 30.0), ("hard", 30.0, 60.0), ("assisted", 60.0, 90.0)]


def as_recorded() -> list[LogFit]:
    t = np.linspace(0, 60, 301)
    made = []
    for k, name in enumerate(("rig-day-up", "rig-day-down")):
        u, left = 50 + 40 * np.sin((k + 1) * 0.2 * t), 0.02 * np.sin(5 * t)
        curve = LogCurve(*(tuple(part.tolist()) for part in (t, u, u / 20 + left, u / 20, left)))
        made.append(LogFit(name, fit_pct=98.0 - k, one_step_pct=99.0, curve=curve))
    return made


def response(with_models: bool = True) -> Response:
    """1/(1 + j f): half power at 1 Hz, 45° behind."""
    f = np.geomspace(0.05, 10, 40)
    h = 0.04 / (1 + 1j * f)
    size, angle = np.abs(h), np.degrees(np.angle(h))
    rows = (f, size, 0.8 * size, 1.2 * size, angle, 3 + 12 * f, 1 / (1 + 0.02 * f**2))
    models = (1.05 * size, angle - 2, 0.9 * size, angle + 8) if with_models else ()
    return Response("chirp", *(tuple(one.tolist()) for one in (*rows, *models)))


DRAWN: dict[str, Callable[[], Figure]] = {
    "fig02_pwm": lambda: clutch.pwm_period(Apparatus()),
    "fig03_friction_steps": lambda: frictions.friction_steps(force_set(), friction_fit("friction-force")),
    "fig04_friction_over_stress": lambda: frictions.friction_over_stress(friction_fit("friction-force")),
    "fig05_friction_over_speed": lambda: frictions.friction_over_speed(friction_fit("friction-speed")),
    "fig06_hold_and_release": lambda: clutch.hold_and_release(clutch.held_levels(clutch_set()), "%", "N·m"),
    "fig07_nonlinear_model": lambda: clutch.nonlinear_model(clutch_set(1.05), clutch_fit()),
    "fig08_linear_model": lambda: clutch.linear_model(clutch_set(), clutch_fit()),
    "model_over_duty": lambda: values.polynomials(clutch_fit()),
    "input_gain": lambda: clutch.input_gain(clutch_fit()),
    "fig09_shear_per_field": lambda: clutch.shear_per_field(clutch_fit()),
    "residuals_nonlinear": lambda: checks.residuals(clutch_set(1.05), clutch_fit(), "nonlinear"),
    "fig11_steps": lambda: replays.tracking(traces(), with_error=False),
    "fig12_multisine": lambda: replays.tracking(traces(), 3.0),
    "fig13_sweep": lambda: replays.sweep(tones()),
    "fig16_rehab": lambda: rehab.training(*session()),
    "level_steps": lambda: level_steps.level_steps(*staircase()),
    "steps_over_level": lambda: level_steps.over_level(up_and_down(), ("%", "N·m")),
    "recorded_logs": lambda: recorded.recorded_logs(as_recorded(), ("%", "N·m")),
    "bode": lambda: recorded.bode([response()], ("%", "N·m")),
    "log_replay": lambda: replays.recorded_duty(traces()),
    "guarantee_in_replay": lambda: replays.guarantee(robust_term()),
    "fig17_rehab_errors": lambda: rehab.errors({"soft": np.arange(9.0), "hard": 2 * np.arange(9.0)}),
    "compare": lambda: values.two_fits([("before", clutch_fit()), ("after", clutch_fit(1.3))]),
}


@pytest.mark.parametrize("name", DRAWN)
def test_axes_name_their_unit_and_widths_are_ieee_columns(name: str):
    with style.look():
        figure = DRAWN[name]()
    assert figure.get_figwidth() in (3.5, 7.16)
    for axes in figure.axes:
        labels = [label for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
        for label in labels:
            assert "(" in label and label.rstrip().endswith(")"), label


def letters(figure: Figure) -> list[Any]:
    """Every text that is drawn."""
    figure.canvas.draw()
    return [one for one in figure.findobj(Text) if one.get_visible() and one.get_text().strip()]


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_no_letter_is_smaller_than_eight_points_and_none_hangs_over_the_edge(name: str):
    with style.look():
        figure = DRAWN[name]()
        shown = letters(figure)
    assert shown and min(one.get_fontsize() for one in shown) >= 8
    width, height = figure.get_size_inches() * figure.dpi
    numbers = re.compile(
        r"[−\d.e$^{}×-]+|[$].mathdefault.*|resistive.*|assisted"
    )  # ticks beyond the limits are not drawn
    for one in shown:
        if numbers.fullmatch(one.get_text()) or (one.axes is not None and not one.axes.get_visible()):
            continue
        box = one.get_window_extent()
        assert box.x0 > -1 and box.x1 < width + 1 and box.y0 > -1 and box.y1 < height + 1, one.get_text()


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN)
def test_legends_are_off_the_data_and_panels_have_letters(name: str):
    with style.look():
        figure = DRAWN[name]()
        figure.canvas.draw()
    panels = [axes for axes in figure.axes if axes.get_visible() and axes.get_label() != "<colorbar>"]
    for axes in panels:
        if (legend := axes.get_legend()) is not None:
            box, plot = legend.get_window_extent(), axes.get_window_extent()
            assert box.y0 >= plot.y1 - 1 or box.x0 >= plot.x1 - 1
    if len(panels) > 1:
        assert [axes.get_title("left")[:3] for axes in panels] == [f"({mark})" for mark in "abcdef"[: len(panels)]]


def test_widths_and_letters_are_the_journals_own():
    with style.look(style.Look(3.3, 6.9, "STIXGeneral")):
        one, both = DRAWN["input_gain"](), DRAWN["fig04_friction_over_stress"]()
        assert letters(one)[0].get_fontname() == "STIXGeneral"
    assert (one.get_figwidth(), both.get_figwidth()) == (3.3, 6.9)


@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_fonts_are_inside_the_file(kind: str):
    with style.look():
        held = vector_of(DRAWN["input_gain"](), kind)
    assert b"/FontFile2" in held and b"/Type3" not in held if kind == "pdf" else b"<text" not in held


def test_shear_point_by_hand():
    """4.372 N·m over 2·2π(0.06³ − 0.04³)/3 = 6.367e-4 m³ is 6.867 kPa; 300 V over 95 µm is 3.158 V/µm."""
    field, stress = clutch.shear_point(clutch_fit())
    assert field == pytest.approx(3.1579, rel=1e-4)
    assert stress == pytest.approx(4.372 / 6.36696e-4 / 1e3, rel=1e-4)


def test_lost_and_left_by_hand():
    """A drive that peaks at 2, is held at 1.5 in the end and keeps 0.3 afterwards: 25 % lost, 20 % left."""
    t = np.linspace(0, 20, 2001)
    torque = np.where(t <= 10, np.where(t < 5, 2.0, 1.5), 0.3)
    held = clutch.Held(100.0, t, torque, 10.0)
    assert held.lost_pct == pytest.approx(25) and held.left_pct == pytest.approx(20)


def test_residuals_of_the_truth_are_nothing():
    for _level, _t, r in checks.residuals_of(clutch_set(), clutch_fit(), "nonlinear"):
        assert np.abs(r).max() < 1e-12
    (_level, _t, r) = checks.residuals_of(clutch_set(1.1), clutch_fit(), "friction")[0]
    assert np.abs(r).max() > 0.01


def test_a_residual_map_is_the_mean_of_its_stretches():
    """A residual of 0.5 in the first tenth of a second and −0.25 after one second stands there, and nowhere else."""
    t = np.linspace(0, 10, 100_001)
    r = np.where(t < 0.1, 0.5, np.where(t > 1, -0.25, 0.0))
    found = checks.residual_map([(10.0, t, r), (20.0, t, 0 * r)])
    middle = (found.edges_s[:-1] + found.edges_s[1:]) / 2
    assert found.levels == (10.0, 20.0) and found.mean[1] == pytest.approx(0)
    assert found.mean[0, found.edges_s[1:] <= 0.1] == pytest.approx(0.5)
    assert found.mean[0, found.edges_s[:-1] >= 1.0] == pytest.approx(-0.25)
    between = (found.edges_s[:-1] >= 0.1) & (found.edges_s[1:] <= 1.0)
    assert between.any() and found.mean[0, between] == pytest.approx(0) and np.all(np.diff(middle) > 0)


def test_a_curve_that_only_crosses_the_axis_is_not_drawn():
    """τ2 of millions of seconds that falls below the single levels' about one input: no vertical line."""
    u = np.linspace(100, 300, 201)
    far, near = 1e6 * ((u - 225) / 100) ** 2, 1e-4 * (u - 100) ** 2
    assert np.isnan(values.on_axis(far, 0.7)).all() and values.top_of(far, 0.7) == 0.7
    assert values.top_of(near, 0.7) == pytest.approx(3 * 0.7)
    assert np.isfinite(values.on_axis(near, 2.1)).sum() == (near < 1.3 * 2.1).sum() > 100


@pytest.mark.parametrize(
    ("end", "ticks"), [(3.0, [0.2, 0.5, 1, 2]), (60.0, [0.3, 1, 3, 10, 30]), (3e3, [1, 10, 100, 1000])]
)
def test_ticks_of_the_residual_map_stand_apart(end: float, ticks: list[float]):
    assert checks.ticks(0.15, end) == ticks


def test_the_linear_model_is_not_drawn_below_zero():
    """At 20 % it ends at (0.0783·20 − 1.34)/1.84 = 0.12 N·m; with c0 = −2 below zero."""
    fit = clutch_fit()
    below = msgspec.structs.replace(fit, linear=msgspec.structs.replace(fit.linear, c0=-2.0))
    drawn = [len(clutch.linear_model(clutch_set(), one).axes[1].lines) for one in (fit, below)]
    assert drawn == [3, 2]


def test_a_step_is_drawn_with_the_curve_that_was_fitted_to_it():
    data, shapes = staircase()
    assert [(step.name, one.run) for step, one in level_steps.paired(data, shapes[1:])] == [("s1", "s1"), ("s2", "s2")]
    lines = [line for line in level_steps.level_steps(data, shapes).axes[0].lines if len(line.get_xdata()) > 2]
    assert lines[0].get_ydata()[-1] == pytest.approx(lines[1].get_ydata()[-1] + 0.05, abs=1e-6)


def test_modes_become_spans():
    t = np.arange(6.0)
    assert rehab.mode_spans(t, ["soft"] * 2 + ["hard"] * 3 + ["soft"]) == [
        ("soft", 0, 1),
        ("hard", 2, 4),
        ("soft", 5, 5),
    ]


def test_gains_and_time_constants_stand_over_the_level_up_and_down_apart():
    shapes = up_and_down()
    gain, tau1, tau2 = level_steps.over_level(shapes, ("V", "N")).axes
    up, down = (bars.lines[0] for bars in gain.containers)
    assert up.get_xdata() == pytest.approx([50, 100, 150]) and down.get_xdata() == pytest.approx([0, 50, 100])
    assert down.get_ydata() == pytest.approx([0.8 * one.gain for one in shapes[:3]])
    assert tau1.containers[1].lines[0].get_ydata() == pytest.approx([one.tau1 for one in shapes[3:]])
    assert len(tau2.containers) == 1 and gain.get_ylabel() == "Gain (N/V)"  # falls have one time constant here
    single = [msgspec.structs.replace(one, tau2=None) for one in shapes]
    assert len(level_steps.over_level(single, ("V", "N")).axes) == 2


def test_many_logs_are_drawn_as_the_best_the_middle_and_the_worst():
    logs = [msgspec.structs.replace(as_recorded()[0], name=f"log-{k}", fit_pct=90.0 - k) for k in range(7)]
    assert [one.name for one in recorded.drawn_logs(logs)] == ["log-0", "log-3", "log-6"]
    assert recorded.drawn_logs([LogFit("none")]) == []
    assert recorded.titles(["rig-day-up", "rig-day-down"]) == ["up", "down"]


def test_the_bode_plot_shows_the_response_its_band_and_the_models_where_there_are_any():
    known = response()
    gain, phase, coherence = recorded.bode([known], ("V", "N")).axes
    assert gain.lines[0].get_ydata() == pytest.approx(known.gain) and gain.get_ylabel() == "Gain (N/V)"
    (band,) = gain.collections
    low = band.get_paths()[0].vertices[:, 1].min()
    assert low == pytest.approx(min(known.gain_low))
    assert phase.lines[1].get_ydata() == pytest.approx(known.nonlinear_phase_deg)
    assert coherence.lines[0].get_ydata() == pytest.approx(known.coherence)
    assert len(recorded.bode([response(with_models=False)], ("V", "N")).axes[0].lines) == 1
