"""The tables of `eaid fit`: each model's numbers as they stand in fit.json, with 95 % intervals, the estimates beside
each other, and how well each level is followed."""

from collections.abc import Iterable, Mapping, Sequence

from eaid.cli import console
from eaid.results.common import AbsError, Huber, HuberPart, Interval, Solver
from eaid.results.fit import Estimate, Fit, Friction, FrictionLevel, Linear, Nonlinear, Pooled, Release
from eaid.results.steps import StepShape


def tables(fit: Fit, verbose: bool = False) -> None:
    """A fit for people, a short table or two a model; the intervals of other estimates only where `verbose`."""
    unit, out = fit.data.input_unit or "input", fit.data.output_unit or "output"
    way = (
        f"95 % intervals ({fit.uncertainty.ci}; scatter from {fit.uncertainty.scatter_from})" if fit.uncertainty else ""
    )
    if fit.friction is not None:
        friction_tables(fit.friction, unit, out, way)
    if fit.nonlinear is not None:
        nonlinear_tables(fit.nonlinear, unit, out, way, verbose)
    if fit.linear is not None:
        linear_tables(fit.linear, unit, out)
    if fit.release is not None:
        release_table(fit.release, unit, out)
    if fit.steps:
        step_table(fit.steps, unit, out)


def verdict_cell(solver: Solver | None) -> str:
    """The verdict for a table."""
    if solver is None:
        return "-"
    if not solver.converged:
        return "NOT CONVERGED"
    return "converged, at a constraint" if solver.at_bounds else "converged"


def friction_tables(part: Friction, unit: str, out: str, way: str) -> None:
    """T_s, τ1, τ2 of each level, their intervals, and the trends."""
    rows = [
        [
            _place(row), f"{row.Ts:.5g}", f"{row.tau1:.4g}", f"{row.tau2:.4g}", f"{row.C:.3g}", _number(row.C_f),
            _number(row.rmse, 3), _number(row.fit_pct), verdict_cell(row.solver),
        ]
        for row in part.levels
    ]  # fmt: skip
    if not rows:
        return
    columns = [f"level [{unit}]", f"T_s [{out}]", "τ1 [s]", "τ2 [s]", "C", "C_f", f"RMSE [{out}]", "fit %", "verdict"]
    console.table("Friction curve of each level, Eq. (3)", columns, rows)
    sure = [row for row in part.levels if row.ci95 is not None]
    if sure:
        cells = [[f"{row.level:g}", *(_span(getattr(row.ci95, k)) for k in ("Ts", "tau1", "tau2"))] for row in sure]
        console.table(f"{way}: each level", [f"level [{unit}]", f"T_s [{out}]", "τ1 [s]", "τ2 [s]"], cells)
    if part.trends:
        cells = [
            [name, row.over, row.form, ", ".join(f"{c:.5g}" for c in row.coefficients), _number(row.rmse, 3)]
            for name, row in part.trends.items()
        ]
        console.table("Trends", ["value", "over", "form", "coefficients", "RMSE"], cells)
    huber_table("friction curves", part.robust, unit)


def nonlinear_tables(part: Nonlinear, unit: str, out: str, way: str, verbose: bool) -> None:
    """The coefficients, lowest power first, and the curves: of the estimate that is used, the others beside it."""
    estimates = part.estimates
    rows = [
        _row("τ1(u)", "s", (one.tau1 for one in estimates.values())),
        _row("τ2(u)", "s", (one.tau2 for one in estimates.values())),
        _row("T_s(u)", out, (one.Ts for one in estimates.values())),
        _row("C", "1", ([one.C] for one in estimates.values())),
        _row("u", unit, (one.u_range for one in estimates.values())),
        _row("RMSE", out, ([one.rmse] for one in estimates.values())),
        _row("fit %", "%", ([one.fit_pct] for one in estimates.values())),
        _row("|error|, mean and sd", out, (_mean_sd(one.abs_error)
                                           for one in estimates.values())),
    ]  # fmt: skip
    if part.hold_out is not None:
        held = ([None if one.hold_out is None else one.hold_out.rmse] for one in estimates.values())
        rows.append(_row("RMSE on held-out levels", out, held))
    rows.append(["verdict", "", *(verdict_cell(one.solver) for one in estimates.values())])
    title = "Nonlinear model, Eqs. (4)–(7); polynomials lowest power first"
    console.table(title, ["", "unit", *heads(estimates)], rows)
    shown = estimates if verbose else dict(list(estimates.items())[:1])
    _curves(f"{way}: the nonlinear model's curves", shown, unit)
    huber_table("nonlinear model", part.robust, unit)


def linear_tables(part: Linear, unit: str, out: str) -> None:
    """a0, b0, c0 under both weights with their intervals, the bounds of B, and each level's own."""
    models: dict[str, Pooled] = {f"{part.weights} weights": part}
    if part.other_weights is not None:
        models[f"{part.other_weights.weights} weights"] = part.other_weights
    rows = []
    for name, what in (("a0", "1/s"), ("b0", f"{out}/(s·{unit})"), ("c0", f"{out}/s")):
        rows.append(_row(name, what, ([getattr(one, name)] for one in models.values())))
        if part.ci95 is not None:
            rows.append(["", "", *(_span(getattr(one.ci95, name, None)) for one in models.values())])
    rows.append(_row("RMSE", out, ([one.rmse] for one in models.values())))
    rows.append(_row("fit %", "%", ([one.fit_pct] for one in models.values())))
    blank = [""] * (len(models) - 1)
    if part.hold_out is not None:
        rows.append(["RMSE on held-out levels", out, _number(part.hold_out.rmse, 6), *blank])
    if (b := part.bounds) is not None:
        rows.append(["B_m … B_M", f"{unit}·s/({out})", f"{_number(b.B_m)} … {_number(b.B_M)} ({b.convention})", *blank])
        if b.ci95 is not None:
            rows += [[f"{name}, 95 %", "", _span(getattr(b.ci95, name)), *blank] for name in ("B_m", "B_M")]
    rows.append(["verdict", "", *(verdict_cell(one.solver) for one in models.values())])
    console.table("Linear model, Eq. (8), all levels at once", ["", "unit", *heads(models)], rows)
    huber_table("linear model", part.robust, unit)
    cells = [
        [
            f"{r.level:g}", f"{r.a0:.5g}", f"{r.gain:.5g}", _number(r.b0), _number(r.B), _number(r.rmse, 3),
            _number(r.fit_pct),
        ]
        for r in part.per_level
    ]  # fmt: skip
    columns = [f"level [{unit}]", "a0 [1/s]", f"gain [{out}]", "b0", "B", f"RMSE [{out}]", "fit %"]
    console.table(f"Linear model of each level ({b.convention if b is not None else ''})", columns, cells)


def heads(found: Iterable[str]) -> list[str]:
    """The estimates as the heads of their columns: the first is the one that is used."""
    return [f"{name} (used)" if k == 0 else name for k, name in enumerate(found)]


def _mean_sd(error: AbsError | None) -> list[float | None]:
    return [None, None] if error is None else [error.mean, error.sd]


def _row(name: str, unit: str, values: Iterable[Sequence[float | None]]) -> list[str]:
    return [name, unit, *(", ".join(_number(value, 6) for value in own) for own in values)]


def _curves(title: str, estimates: Mapping[str, Estimate], unit: str) -> None:
    """T_s, τ1, τ2 at each level by the estimates with their intervals; nothing where one has none."""
    curves = [one.curves for one in estimates.values()]
    if not all(curves):
        return
    rows = [
        [
            f"{same[0].level:g}",
            *(_span(getattr(row.ci95, k, None)) for k in ("Ts", "tau1", "tau2") for row in same),
        ]
        for same in zip(*curves, strict=True)
    ]
    columns = [f"{name}, {way}" for name in ("T_s", "τ1", "τ2") for way in estimates]
    console.table(title, [f"level [{unit}]", *columns], rows)


def huber_table(model: str, told: Huber | None, unit: str) -> None:
    """How much each level, and which parts of it, Huber's loss held back; nothing under squares."""
    if told is None:
        return
    rows = [
        [
            f"{row.level:g}", f"{100 * (row.below_one or 0.0):.2g} %", _number(row.mean, 3), _number(row.least, 3),
            "; ".join(part_words(one) for one in row.parts) or "-",
        ]
        for row in told.weights
    ]  # fmt: skip
    title = f"Weights of Huber's loss, {model} (σ = {_number(told.sigma, 3)}; a normal record holds back 18 %)"
    columns = [f"level [{unit}]", "samples held back", "mean weight", "least", "parts that count less than half"]
    console.table(title, columns, rows)


def part_words(one: HuberPart) -> str:
    """A stretch of low weight: its times and its least weight, with the run that stands out."""
    run = f", {one.run}" if one.run else ""
    return f"{one.from_s:.3g}–{one.to_s:.3g} s (down to {_number(one.least, 2)}{run})"


def release_table(part: Release, unit: str, out: str) -> None:
    """Falling beside rising time constants."""
    rows = [
        [f"{r.level:g}", *(_number(v) for v in (r.tau1, r.rising_tau1, r.tau2, r.rising_tau2)), _number(r.residual, 3),
         _number(r.rmse, 3)]
        for r in part.levels
    ]  # fmt: skip
    rows.append(["all", _number(part.tau1), "-", _number(part.tau2), "-", "-", _number(part.rmse, 3)])
    columns = [
        f"level [{unit}]", "τ1 falling [s]", "τ1 rising [s]", "τ2 falling [s]", "τ2 rising [s]", f"left [{out}]",
        f"RMSE [{out}]",
    ]  # fmt: skip
    console.table("Release, beside the rise", columns, rows)


def _place(row: FrictionLevel) -> str:
    """A level, or the two that a step lies between."""
    return f"{row.level:g}" if row.from_ == 0 else f"{row.from_:g} → {row.level:g}"


def _number(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def _span(interval: Interval) -> str:
    return "not determined" if not interval else f"{interval[0]:.4g} … {interval[1]:.4g}"


def step_table(steps: Sequence[StepShape], unit: str, out: str) -> None:
    """Each change of input by itself: gain, shape and time constants."""
    rows = [
        [
            f"{row.from_:g}", f"{row.level:g}", f"{row.start:.4g}", f"{row.change:+.5g}", _number(row.gain), row.shape,
            f"{row.tau1:.4g}", _number(row.tau2), f"{row.C:.3g}", f"{row.dead_time_s:.3g}", _number(row.rmse, 3),
            _number(row.fit_pct),
        ]
        for row in steps
    ]  # fmt: skip
    columns = [
        f"from [{unit}]", "to", f"start [{out}]", f"change [{out}]", f"gain [{out}/{unit}]", "shape", "τ1 [s]",
        "τ2 [s]", "C", "dead [s]", f"RMSE [{out}]", "fit %",
    ]  # fmt: skip
    console.table("Steps, each from its own start", columns, rows)
