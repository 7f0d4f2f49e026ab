"""Step responses: the mean of each level, ± sd, its model, and the level at the curve's end; what the models leave."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from eaid.arrays import Array
from eaid.plant import linear
from eaid.report import panels as ink
from eaid.report.panels import Axis, Line, Panel, Sheet, quantity
from eaid.report.results import Results
from eaid.report.rig import level_text
from eaid.results.fit import Fit
from eaid.results.models import StepShape
from eaid.steps.noise import block_means
from eaid.steps.step import hold_of
from eaid.steps.stepset import LevelStep, StepSet

CurveOverTime = Callable[[Array], Array]
T = TypeVar("T")
LABELLED = 14  # Most levels that are named at the ends of their curves, spread over all
PALER = 0.5  # Of what was measured, however many rows of it: the models stay to be seen above
DRAWN = 24  # Most levels that are drawn: more hide each other


def nonlinear_curves(fit: Fit | None, data: StepSet) -> dict[float, CurveOverTime]:
    """Level → the step response of the nonlinear model, or of the plant of another kind in its place."""
    if fit is None or (fit.nonlinear is None and fit.plant_ is None):
        return {}
    return {one.level: partial(fit.curve, "plant", one.level) for one in data.levels}


def single_curves(fit: Fit | None) -> dict[float, CurveOverTime]:
    """Level → its own fitted curve, that of steps from rest where there are some."""
    rows = sorted(fit.friction_levels, key=lambda row: row.from_ == 0) if fit is not None else ()
    return {row.level: row.predict for row in rows}


def some_of(levels: Sequence[T], most: int = DRAWN) -> list[T]:
    """All of them, or so many spread evenly, the first and the last among them."""
    if len(levels) <= most:
        return list(levels)
    return [levels[round(k * (len(levels) - 1) / (most - 1))] for k in range(most)]


def fine_times(t_end: float, points: int = 150) -> Array:
    """Instants at which a model is drawn [s]: dense where it is steep."""
    return np.unique(np.concatenate([[0.0], np.geomspace(1e-3, 1, points) * t_end]))


# What was measured: time, values, half of the band around them or None, what it is called, the model's RMSE or ""
Curve = tuple[Array, Array, Array | None, str, str, CurveOverTime | None]


def curves_panel(curves: Sequence[Curve], y: Axis) -> Panel:
    """Each level's curve, its band and its model."""
    colours, named = ink.level_colours(len(curves)), {one[3] for one in some_of(curves, LABELLED)}
    bands, lines, models = [], list[Line](), list[Line]()
    for (t, mean, sd, text, rmse, model), colour in zip(curves, colours, strict=True):
        if sd is not None:
            bands.append(ink.Band(t, mean - sd, mean + sd, colour, 0.2))
        end = (f"{text}: {rmse}" if rmse else text) if text in named else ""
        lines.append(Line(t, mean, f"{text}, measured", colour, width=1.5, alpha=PALER, end=end))
        if model is not None:
            fine = fine_times(float(t[-1]))
            models.append(ink.model_line(fine, model(fine), f"{text}, model{', RMSE ' if rmse else ''}{rmse}"))
    keys = [Line((), (), "measured" + " ± sd" * bool(bands), colours[len(colours) // 2], width=1.5, alpha=PALER)]
    if any(model is not None for *_, model in curves):
        said = f"RMSE ({y.unit})" if any(rmse for *_, rmse, _ in curves) else ""
        keys.append(ink.model_line(np.empty(0), np.empty(0), f"model, {said}".rstrip(", ")))
    return Panel(ink.OF_STEP, y, [*lines, *models], bands, legend="above", columns=2, keys=keys)


def steps_panel(
    data: StepSet,
    fitted: Mapping[float, CurveOverTime],
    notes: Mapping[float, str] = MappingProxyType({}),
    spread: bool = False,
) -> Panel:
    """Each level's mean, its model, and on request the band of ± one sd; `notes` follow its name."""
    curves = [
        (one.time_s, one.mean, one.sd if spread and len(one.runs) > 1 else None,
         level_text(one.level, data.input_unit), notes.get(one.level, ""), fitted.get(one.level))
        for one in some_of(data.levels)
    ]  # fmt: skip
    return curves_panel(curves, quantity(data.output_unit))


def fitted_steps(fit: Fit) -> Panel:
    """The step responses of the first model that was fitted (nonlinear, linear, friction), a line a level."""
    data, time = fit.data, fine_times(max(fit.data.record_s, default=20.0))
    levels = data.levels or (() if fit.recorded is None else np.linspace(*fit.recorded.u_range, 5).tolist())
    shown = fit.predict(levels, time.tolist())
    lines = [
        Line(time, values, level_text(float(str(level)), data.input_unit), colour, width=1.5)
        for colour, (level, values) in zip(ink.level_colours(shown.shape[1]), shown.items(), strict=True)
    ]
    return Panel(ink.OF_STEP, quantity(data.output_unit), lines, legend="above")


def nonlinear_model(data: StepSet, results: Results) -> Sheet:
    """Fig. 7: mean ± sd per level; the nonlinear model, Eq. (4), dashed, each level's RMSE behind its name."""
    fit = results.fit("clutch")
    rows = fit.nonlinear.per_level if fit is not None and fit.nonlinear is not None else ()
    notes = {row.level: f"{row.rmse:.3f}" for row in rows if row.rmse is not None}
    return Sheet([steps_panel(data, nonlinear_curves(fit, data), notes, spread=True)], 3.6, live=True)


def friction_steps(results: Results) -> Sheet | None:
    """Fig. 3: steps of the force dataset, else of the speed dataset, and the fitted Eq. (3) where there is any."""
    kind = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    if (data := results.data_of(kind)) is None:
        return None
    return Sheet([steps_panel(data, single_curves(results.fit(kind)))], 2.9, ink.COLUMN_IN, live=True)


def linear_model(data: StepSet, fit: Fit) -> Sheet | None:
    """Fig. 8: what was measured, and Eq. (8) of all levels, dashed, but where it ends below zero, as no clutch does."""
    if fit.linear is None:
        return None
    above = [row.level for row in data.levels if linear.steady(fit.linear.parameters, row.level) > 0]
    return Sheet([steps_panel(data, {level: partial(fit.curve, "linear", level) for level in above})], 3.2)


MOST_LEVEL_STEPS = 12  # Most steps from level to level that are drawn
HELD_LOOKS = ((ink.BLUE, "-"), (ink.VERMILLION, "--"), (ink.GREEN, "-."))  # Of Fig. 6, the highest level first


def level_step_panels(results: Results) -> Sheet | None:
    """Change of output over time since each step from level to level, and the fitted curves (dashed)."""
    for one in results.data:
        data, fit = one.result, results.fit(one.result.kind)
        if fit is not None and paired(data, fit.steps):
            return Sheet([level_steps_panel(data, fit.steps)], 3.0)
    return None


def paired(data: StepSet, shapes: Sequence[StepShape]) -> list[tuple[LevelStep, StepShape]]:
    """Each recorded step and what was fitted to it."""
    known = {(one.run, one.from_, one.level): one for one in shapes}
    keys = [((one.name, one.from_level, one.level), one) for one in data.level_steps]
    return [(step, known[key]) for key, step in keys if key in known]


def level_steps_panel(data: StepSet, shapes: Sequence[StepShape]) -> Panel:
    """The steps, each from its own start."""

    def change(shape: StepShape, t_s: Array) -> Array:
        return shape.predict(t_s) - shape.start

    def called(step: StepShape) -> str:
        return f"{step.from_:.3g} → {step.level:.3g}".replace("-", "−")

    curves = [
        (step.time_s, step.output - shape.start, None, called(shape), "", partial(change, shape))
        for step, shape in some_of(paired(data, shapes), MOST_LEVEL_STEPS)
    ]
    return curves_panel(curves, Axis("Change of output", data.output_unit))


def hold_and_release(data: StepSet) -> Sheet | None:
    """Fig. 6: the highest, the middle and the lowest level with rise and release; shares lost and left."""
    rising = {level.level: level for level in data.levels}
    pairs = [(rising[release.level], release) for release in data.releases if release.level in rising]
    if not pairs:
        return None
    lines, ends = [], []
    for (step, release), (colour, dash) in zip(some_of(pairs, 3)[::-1], HELD_LOOKS, strict=False):
        hold = hold_of(step.runs)
        lost, left = hold.lost_pct, 100 * float(block_means(release.mean)[-1]) / float(hold.held.mean())
        ends.append(float(2 * step.time_s[-1] - step.time_s[-2]))
        label = f"{level_text(step.level, data.input_unit)}: lost {lost:.1f} %, left {left:.1f} %".replace("-", "−")
        time, output = np.concatenate([step.time_s, ends[-1] + release.time_s]), np.r_[step.mean, release.mean]
        lines.append(Line(time, output, label, colour, dash))
    low, high = min(float(line.y.min()) for line in lines), max(float(line.y.max()) for line in lines)
    room, end = high - low or 1.0, ends[0]
    panel = Panel(
        ink.OF_STEP, quantity(data.output_unit, low - 0.05 * room, high + 0.18 * room), lines,
        spans=[ink.Span(0, end, "#E8E8E8")],
        notes=[ink.Note("input on", end / 2, 0.985, "y", va="top"),  # above every curve
               ink.Note("off", (end + float(lines[0].x[-1])) / 2, 0.985, "y", va="top")],
        legend="above", columns=1,
    )  # fmt: skip
    return Sheet([panel], 2.7, ink.COLUMN_IN)
