"""Tables of one fit: the single levels, Tables I–III, the linear model, release, held-out levels, Huber's weights."""

from collections.abc import Sequence

from eaid.report import rig as published
from eaid.report.rig import gain, of_the_paper, rate
from eaid.report.tables import (
    INTERVAL,
    SYMBOLS,
    Cell,
    Name,
    Table,
    columns,
    level,
    number,
    table_of,
    with_interval,
    with_unit,
)
from eaid.results.common import ci95_of
from eaid.results.fit import Estimate, Fit, Nonlinear, Trend
from eaid.results.recorded import FallTest, LogFit, Loop

PARAMETERS = ("Ts", "tau1", "tau2")


def unit_of(fit: Fit, name: str) -> str:
    """Unit of a fitted value."""
    return {"Ts": fit.data.output_unit, "C_f": "1", "tau1": "s", "tau2": "s"}[name]


def estimates_of(part: Nonlinear) -> dict[str, Estimate]:
    """The estimates of the nonlinear model by name, the one that is used first."""
    beside = {} if part.joint is None or part.estimator == "joint" else {"joint": part.joint}
    return {part.estimator: part, **beside}


def levels_table(fit: Fit) -> Table:
    """The friction curve of each level."""
    rows, out = fit.friction.levels if fit.friction else (), fit.data.output_unit
    rig, force = fit.data.apparatus, fit.data.kind == "friction-force" and of_the_paper(fit.data)
    whose = (
        "One curve for each level by itself." if fit.nonlinear is None else "The nonlinear model's curve at each level."
    )
    how = f" Intervals: {fit.uncertainty.ci}." if fit.uncertainty and fit.uncertainty.ci != "none" else ""
    return table_of(
        "Single levels, Eq. (3)", f"{whose}{how}", rows,
        (("level", fit.data.input_unit),
         lambda one: Name(level(one.level) if not one.from_ else f"{level(one.from_)} → {level(one.level)}")),
        (("stress", "kPa", 3), lambda one: rig.stress_kpa(one.level)) if force else None,
        *(part for name in PARAMETERS for part in with_interval((SYMBOLS[name], unit_of(fit, name)), name)),
        (("RMSE", out, 3), "rmse"),
        (("fit", "%", 3), "fit_pct") if any(one.fit_pct is not None for one in rows) else None,
    )  # fmt: skip


def formula(trend: Trend, variable: str) -> str:
    """A fitted trend as one line of text, by its form."""
    c = trend.coefficients

    def signed(value: float) -> str:
        return f"{'−' if value < 0 else '+'} {number(abs(value))}"

    if trend.form == "linear":
        return f"{number(c[0])} {variable} {signed(c[1])}"
    if trend.form == "merged-exponential":
        return f"({number(c[0])} {signed(c[1])} {variable}) e^({number(c[2])} {variable})"
    return f"{number(c[0])} e^({number(c[1])} {variable}) {signed(c[2])} e^({number(c[3])} {variable})"


def trends_table(fit: Fit) -> Table:
    """Tables I and II: fitted values over normal stress, or over speed; published ones where they belong."""
    force, paper = fit.data.kind == "friction-force", of_the_paper(fit.data)
    printed = published.TABLE_I if force else published.TABLE_II
    variable = "σ" if force else "Ω"
    rows: list[tuple[Cell, ...]] = []
    trends = fit.friction.trends if fit.friction else {}
    for name, (said, _coefficients, rmse) in printed.items():
        ours = trends.get(name)
        shown = formula(ours, variable) if ours is not None and ours.coefficients else "not fitted"
        rows.append((SYMBOLS[name], unit_of(fit, name), said, rmse, shown, ours.rmse if ours else None))
    heads = columns("parameter", "unit", "published", ("published RMSE", "", 3), "ours", ("our RMSE", "", 3))
    if not paper:
        stress = fit.friction is not None and fit.friction.over_stress
        said = "normal stress in kPa" if stress else f"level in {fit.data.input_unit or 'the unit of its file'}"
        caption = f"{variable} is the {said}."
        return Table("Trends over the level", caption, heads, tuple(rows)).without(2, 3)
    if force:
        return Table("Table I", "Over the normal stress σ in kPa, at constant speed.", heads, tuple(rows))
    caption = "Over the rotation speed Ω in RPM, at constant force. The published τ2 is two equal rates with huge "
    caption += "opposite weights: at its printed digits only 100 e^(−0.0507 Ω) is left."
    return Table("Table II", caption, heads, tuple(rows))


def table_iii(fit: Fit) -> Table:
    """The ten coefficients and C of the nonlinear model, every estimate beside the one that is used."""
    part = fit.nonlinear
    assert part is not None
    shown = estimates_of(part)
    paper = of_the_paper(fit.data)
    rows: list[tuple[Cell, ...]] = []
    for letter, name in (("a", "tau1"), ("b", "tau2"), ("c", "Ts")):
        unit, per = unit_of(fit, name), fit.data.input_unit or "input"
        for power in range(len(getattr(part, name))):
            printed = published.TABLE_III[name]
            cells: list[Cell] = [f"{letter}_{power}", f"{SYMBOLS[name]}, u^{power}" if power else SYMBOLS[name]]
            cells.append(number(printed[power], 3) if power < len(printed) else None)
            for one in shown.values():
                ends = ci95_of(one, name) or ()
                cells += [getattr(one, name)[power], ends[power] if power < len(ends) else None]
            rows.append((*cells, f"{unit}/{per}^{power}" if power > 1 else f"{unit}/{per}" if power else unit))
    last: list[Cell] = ["C", "share of the fast part", number(published.TABLE_III["C"][0], 2)]
    for one in shown.values():
        last += [number(one.C, 2), ci95_of(one, "C")]
    rows.append((*last, "1"))
    heads = ["symbol", "belongs to", "published"]
    for k, name in enumerate(shown):
        heads += [f"ours, {name}{' (used)' if k == 0 and len(shown) > 1 else ''}", "95 % interval"]
    caption = "The nonlinear model: τ1(u), τ2(u) and T_s(u) as polynomials of the input u."
    if not paper:
        return Table("Nonlinear model", caption, columns(*heads, "unit"), tuple(rows)).without(2)
    caption += " The published T_s gives 0.057 N·m at full duty, where the paper's own figures show about 4 N·m."
    return Table("Table III", caption, columns(*heads, "unit"), tuple(rows))


def linear_table(fit: Fit) -> Table:
    """Eq. (8): a0, b0, c0."""
    part = fit.linear
    assert part is not None
    paper, out = of_the_paper(fit.data), fit.data.output_unit
    units = {"a0": "1/s", "b0": rate(fit.data.input_unit, out), "c0": f"{out}/s"}
    rows: list[tuple[Cell, ...]] = [
        (name, number(published.LINEAR[name], 3), getattr(part, name), ci95_of(part, name), unit)
        for name, unit in units.items()
    ]
    rows.append(("RMSE", "–", part.rmse, None, out))
    heads = columns("symbol", "published", "ours", "95 % interval", "unit")
    said = "dT/dt = −a0 T + b0 u + c0, fitted to all levels at once."
    table = Table("Linear model, Eq. (8)", said, heads, tuple(rows))
    return table if paper else table.without(1)


def input_gain_table(fit: Fit) -> Table:
    """Eq. (8) fitted to each level: a0, steady value, B."""
    part, unit, out = fit.linear, fit.data.input_unit, fit.data.output_unit
    assert part is not None
    caption = "The linear model of each level by itself."
    if (bounds := part.bounds) is not None:
        caption += f" B_m = {number(bounds.B_m)} and B_M = {number(bounds.B_M)} are "
        caption += "the least and the largest B of the levels kept."
    if of_the_paper(fit.data):
        caption += " Published: 12.4 and 42.6."
    return table_of(
        "Input gain of each level", caption, part.per_level,
        (("level", unit), lambda one: level(one.level)), (("a0", "1/s"), "a0"), (("steady value", out), "gain"),
        ("b0", "b0"), (("c0", f"{out}/s"), "c0"), (("B", gain(unit, out)), "B"),
        (INTERVAL, lambda one: ci95_of(one, "B")), (("RMSE", out, 3), "rmse"),
    )  # fmt: skip


def release_table(fit: Fit) -> Table:
    """Time constants of the falling edges."""
    part = fit.release
    assert part is not None
    heads = columns(("τ1", "s"), ("τ2", "s"), ("RMSE", fit.data.output_unit, 3))
    caption = "How the output falls after the input returns to zero, all levels together."
    return Table("Release", caption, heads, ((part.tau1, part.tau2, part.rmse),))


SHAPES = {"one": "one exponential", "two": "two exponentials", "free": "two, C free", "overshoot": "overshoot"}


def level_steps_table(fit: Fit) -> Table:
    """Each change of input between two holds: start, change, gain and the shape that the evidence asked for."""
    unit, out = fit.data.input_unit, fit.data.output_unit
    return table_of(
        "Steps from level to level",
        "Each change of input between two holds, from its own start; the shape is what the evidence asks for.",
        fit.steps,
        (("step", unit), lambda one: Name(f"{level(one.from_)} → {level(one.level)}")), (("start", out), "start"),
        (("change", out), "change"), (("peak", out), "peak"),
        (("gain", f"{out or 'output'}/{unit or 'input'}"), "gain"),
        ("shape", lambda one: SHAPES.get(one.shape, one.shape)), (("τ1", "s"), "tau1"), (("τ2", "s"), "tau2"),
        (("C", "", 3), "C"), (("dead time", "s", 3), "dead_time_s"), (("RMSE", out, 3), "rmse"),
        (("fit", "%", 3), "fit_pct"),
    )  # fmt: skip


def held_out_table(fit: Fit) -> Table:
    """Errors on levels that were not fitted; no rows where none was held out."""
    rows: list[tuple[Cell, ...]] = []
    for name, part in (("friction", fit.friction), ("nonlinear", fit.nonlinear), ("linear", fit.linear)):
        if part is not None and part.hold_out is not None:
            for row in part.hold_out.levels:
                mean = row.abs_error.mean if row.abs_error else None
                rows.append((name, level(row.level), row.rmse, mean, part.hold_out.fitted_rmse))
    out = fit.data.output_unit
    heads = columns(
        "model", ("level", fit.data.input_unit), ("RMSE", out, 3), ("mean |error|", out, 3),
        ("RMSE on the fitted levels", out, 3),
    )  # fmt: skip
    return Table("Levels held out", "Levels that the fit never saw, predicted from the others.", heads, tuple(rows))


def huber_tables(fit: Fit) -> list[Table]:
    """How much of each level Huber's loss held back, and where; one table a model."""
    found = []
    for name, part in (("friction", fit.friction), ("nonlinear", fit.nonlinear), ("linear", fit.linear)):
        robust = part.robust if part is not None else None
        if robust is None:
            continue
        caption = f"Residuals beyond {number(robust.k)} σ count less, as 1/|residual|; σ by the median is "
        caption += (
            f"{number(robust.sigma, 3)} {fit.data.output_unit}. Normal noise alone holds back 18 % of the samples."
        )
        found.append(table_of(
            f"Weights of Huber's loss, {name} model", caption, robust.weights,
            ("level", lambda one: with_unit(level(one.level), fit.data.input_unit)),
            (("samples held back", "%", 2), lambda one: None if one.below_one is None else 100 * one.below_one),
            (("mean weight", "", 3), "mean"), (("least weight", "", 3), "least"),
        ))  # fmt: skip
    return found


def model_tables(fit: Fit) -> list[Table]:
    """Values of each model, logs as recorded and single levels first; tables without rows are left out."""
    found: list[Table] = []
    if (part := fit.recorded) is not None:
        unit, out = fit.data.input_unit, fit.data.output_unit
        found += [logs_table(part.logs, out), loops_table(part.loops, (unit, out))]
        found.append(falls_table(part.falls))
    if fit.friction is not None:
        found.append(levels_table(fit))
        if fit.friction.trends:
            found.append(trends_table(fit))
    found.append(level_steps_table(fit))
    if fit.nonlinear is not None:
        found.append(table_iii(fit))
    if fit.linear is not None:
        found += [linear_table(fit), input_gain_table(fit)]
    if fit.release is not None:
        found.append(release_table(fit))
    return [table for table in (*found, held_out_table(fit), *huber_tables(fit)) if table.rows]


def judging_tables(fit: Fit) -> list[Table]:
    """Whether the model is right; none without repeats."""
    table = lack_of_fit_table(fit)
    return [table] if table.rows else []


def lack_of_fit_table(fit: Fit) -> Table:
    """What each level's curve misses, against what its repeats scatter."""
    unit, out = fit.data.input_unit, fit.data.output_unit
    rows: list[tuple[Cell, ...]] = [
        (with_unit(level(row.level), unit), row.ratio, row.chance, row.beyond, row.systematic_nm)
        for row in (fit.uncertainty.lack_of_fit if fit.uncertainty else ())
    ]
    caption = "The ratio is what a level's curve misses over what its repeats scatter; beyond what chance allows, the "
    caption += "curve's shape is not quite right there, by the systematic part."
    heads = columns("level", ("ratio", "", 3), ("by chance up to", "", 3), "beyond", ("systematic part", out, 2))
    return Table("Is the model right", caption, heads, tuple(rows))


def logs_table(logs: Sequence[LogFit], out: str) -> Table:
    """One row a log."""
    return table_of(
        "Logs fitted as recorded",
        "Free run: the model driven by the input alone. One step: from each measured sample to the next.",
        logs,
        ("log", lambda log: Name(log.name)), ("input", "input_kind"), (("length", "s", 3), "duration_s"),
        (("rate", "Hz", 3), "rate_hz"), (("idle", out, 3), "idle"), (("RMSE", out, 3), "rmse"),
        (("free-run fit", "%", 3), "fit_pct"), (("one-step fit", "%", 3), "one_step_pct"),
    )  # fmt: skip


def loops_table(loops: Sequence[Loop], units: tuple[str, str]) -> Table:
    """Recorded closed loops: the law that explains the input, its error and limits."""
    unit, out = units
    return table_of(
        "Closed loops as recorded",
        "Error: reference minus output.",
        loops,
        ("loop", lambda loop: Name(loop.name)), (("K_P", f"{unit}/({out})", 3), "K_P"),
        (("K_I", f"{unit}/({out}·s)", 3), "K_I"), (("PI law explains", "%", 3), "law_fit_pct"),
        (("at a limit", "%", 2), lambda loop: 100 * loop.saturated_fraction), (("RMS error", out, 3), "rms_error"),
    )  # fmt: skip


FALLS = {
    "release_tau1": "τ1 of falls to rest (s)",
    "release_tau2": "τ2 of falls to rest (s)",
    "fall_tau1": "τ1 of partial falls, times",
    "fall_tau2": "τ2 of partial falls, times",
    "hysteresis_pct": "T_s after a fall, more by (%)",
}


def falls_table(falls: Sequence[FallTest]) -> Table:
    """Whether falls differ from rises; no rows where nothing was tested."""
    return table_of(
        "Falls against rises",
        "A small p, the probability of such a difference by chance, says that falls go otherwise than rises.",
        falls,
        ("value", lambda one: FALLS[one.name]), (("found", "", 3), "value"),
        (("95 % interval", "", 3), "ci95"), (("p", "", 2), "chance"), ("fitted apart", "fitted"),
    )  # fmt: skip
