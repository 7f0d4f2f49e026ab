"""Tables of one fit: the single levels, Tables I–III, the linear model, release, held-out levels."""

from operator import attrgetter, itemgetter

from eaid.findings.row import SYMBOLS
from eaid.findings.sentences.fitting import kind_in_words
from eaid.plant.linear import PAPER_LINEAR
from eaid.report import rig as published
from eaid.report.rig import gain_unit, of_the_paper
from eaid.report.tables import INTERVAL, OUTSIDE, Cell, Name, Table, level, outside, table_of
from eaid.results.common import ci95_of
from eaid.results.fit import Fit
from eaid.results.models import Trend
from eaid.shown import number


def unit_of_value(fit: Fit, name: str) -> str:
    """Unit of a fitted value."""
    return {"Ts": fit.data.output_unit, "C_f": "1"}.get(name, "s")


def levels_table(fit: Fit) -> Table:
    """The friction curve of each level."""
    rows, out = fit.friction_levels, fit.data.output_unit
    own = fit.nonlinear is None
    whose = "One curve for each level by itself." if own else "The nonlinear model's curve at each level."
    how = f" Intervals: {fit.uncertainty.ci}." if fit.uncertainty and fit.uncertainty.ci != "none" else ""
    return table_of(
        "Single levels", f"{whose}{how}", rows,
        (("level", fit.data.input_unit),
         lambda one: Name(level(one.level) if not one.from_ else f"{level(one.from_)} → {level(one.level)}")),
        (("stress", "kPa", 3), "stress_kpa") if any(one.stress_kpa is not None for one in rows) else None,
        *(part for name in ("Ts", "tau1", "tau2") for part in (
            ((SYMBOLS[name], unit_of_value(fit, name)), name), (INTERVAL, lambda one, name=name: ci95_of(one, name)))),
        (("RMSE", out, 3), "rmse"),
        (("fit", "%", 3), "fit_pct") if any(one.fit_pct is not None for one in rows) else None,
    )  # fmt: skip


def responses_table(fit: Fit) -> Table:
    """How the output of each level comes, stays and goes, as recorded."""
    out = fit.data.output_unit
    quantities = (
        ("engaged", "s", "engaged_s"), ("peak", out, "peak"), ("at", "s", "peak_s"), ("slip", out, "slip"),
        ("held", out, "held"), ("released", "s", "released_s"),
    )  # fmt: skip
    known = [one for one in quantities if any(getattr(row, one[2]) is not None for row in fit.responses)]
    return table_of(
        "Engagement and release",
        "Of the steps themselves: from the step to 90 % of the held output, peak and slip from it where there "
        "is one, mean of the last tenth of the hold, from the release to 10 %. Intervals: Student's t from what runs "
        "differ.",
        fit.responses, (("level", fit.data.input_unit), lambda one: level(one.level)), ("runs", "runs"),
        *(part for head, unit, name in known for part in (
            ((head, unit, 3), name),
            (INTERVAL, lambda one, name=name: "–" if getattr(one, name) is None else ci95_of(one, name)))),
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
    force = fit.data.kind == "friction-force"
    variable = "σ" if force else "Ω"
    trends, of_paper = fit.friction.trends if fit.friction else {}, of_the_paper(fit.data)
    heading = f"Table {'I' if force else 'II'}" if of_paper else "Trends over the level"
    stress = fit.friction is not None and fit.friction.over_stress
    caption = f"{variable} is the level in {fit.data.input_unit}."
    if of_paper and not force:
        caption = "Over the rotation speed Ω in RPM, at constant force. The published τ2 is two equal rates with huge "
        caption += "opposite weights: at its printed digits only 100 e^(−0.0507 Ω) is left."
    elif of_paper or stress:
        caption = f"{variable} is the normal stress in kPa."

    def shown(name: str) -> str:
        ours = trends.get(name)
        return formula(ours, variable) if ours is not None and ours.coefficients else "not fitted"

    table = published.TABLE_I if force else published.TABLE_II
    return table_of(
        heading, caption, table,
        ("parameter", lambda name: SYMBOLS.get(name, name)), ("unit", lambda name: unit_of_value(fit, name)),
        ("published", lambda name: table[name][0]) if of_paper else None,
        (("published RMSE", "", 3), lambda name: table[name][2]) if of_paper else None,
        ("ours", shown), (("our RMSE", "", 3), lambda name: trends[name].rmse if name in trends else None),
    )  # fmt: skip


def table_iii(fit: Fit) -> Table:
    """The ten coefficients and C of the nonlinear model, and the paper's joint estimate of them beside it."""
    part = fit.nonlinear
    assert part is not None
    joint = None if part.estimator == "joint" else part.joint
    rows: list[tuple[Cell, ...]] = []
    names = (("a", "tau1"), ("b", "tau2"), ("c", "Ts"))
    for letter, name in names[:2] if part.Ts_through else names:
        unit, per = unit_of_value(fit, name), fit.data.input_unit
        printed, ends = published.TABLE_III[name], ci95_of(part, name) or ()
        for power, value in enumerate(getattr(part, name)):
            of = f"{SYMBOLS[name]}, u^{power}" if power else SYMBOLS[name]
            paper = number(printed[power], 3) if power < len(printed) else None
            beside = getattr(joint, name)[power] if joint is not None else None
            each = f"{unit}/{per}^{power}" if power > 1 else f"{unit}/{per}" if power else unit
            rows.append((f"{letter}_{power}", of, paper, value, ends[power] if ends else None, beside, each))
    share = (number(part.C, 2), ci95_of(part, "C") if part.C_free else "held",
             number(joint.C, 2) if joint is not None else None)  # fmt: skip
    rows.append(("C", "share of the fast part", number(published.TABLE_III["C"][0], 2), *share, "1"))
    of_paper = of_the_paper(fit.data)
    curves = "τ1(u), τ2(u)" if part.Ts_through else "τ1(u), τ2(u) and T_s(u)"
    caption = f"The nonlinear model: {curves} as polynomials of the input u."
    caption += " T_s(u) goes through values of its own (Ts_through in fit.json)." * bool(part.Ts_through)
    if of_paper:
        caption += " The published T_s gives 0.057 N·m at full duty, where the paper's own figures show about 4 N·m."
    return table_of(
        "Table III" if of_paper else "Nonlinear model", caption, rows,
        ("symbol", itemgetter(0)), ("belongs to", itemgetter(1)), ("published", itemgetter(2)) if of_paper else None,
        (f"ours, {part.estimator}", itemgetter(3)), (INTERVAL, itemgetter(4)),
        ("joint", itemgetter(5)) if joint is not None else None, ("unit", itemgetter(6)),
    )  # fmt: skip


def linear_table(fit: Fit) -> Table:
    """Eq. (8): a0, b0, c0."""
    part, out = fit.linear, fit.data.output_unit
    assert part is not None
    units = {"a0": "1/s", "b0": f"{out}/(s·{fit.data.input_unit})", "c0": f"{out}/s", "rmse": out}
    return table_of(
        "Linear model", "dT/dt = −a0 T + b0 u + c0, fitted to all levels at once.", units,
        ("symbol", lambda name: "RMSE" if name == "rmse" else name),
        ("published", lambda name: number(getattr(PAPER_LINEAR, name, None), 3)) if of_the_paper(fit.data) else None,
        ("ours", lambda name: getattr(part, name)),
        (INTERVAL, lambda name: ci95_of(part, name) if name != "rmse" else "–"),
        ("unit", lambda name: units[name]),
    )  # fmt: skip


def input_gain_table(fit: Fit) -> Table:
    """Eq. (8) fitted to each level: a0, b0, B."""
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
        (("level", unit), lambda one: level(one.level)), (("a0", "1/s"), "a0"),
        ("b0", "b0"), (("c0", f"{out}/s"), "c0"), (("B", gain_unit(unit, out)), "B"),
        (INTERVAL, lambda one: ci95_of(one, "B")), (("RMSE", out, 3), "rmse"),
    )  # fmt: skip


SHAPE_WORDS = {"one": "one exponential", "two": "two exponentials", "free": "two, C free", "overshoot": "overshoot"}
SHAPE_WORDS |= {f"{shape}+dead": f"{words}, dead time" for shape, words in SHAPE_WORDS.items()}


def level_steps_table(fit: Fit) -> Table:
    """Each change of input between two holds: start, change, gain and the shape that the evidence asked for."""
    unit, out = fit.data.input_unit, fit.data.output_unit
    return table_of(
        "Single steps",
        "Each change of input between two holds, from its own start; the shape is what the evidence asks for.",
        fit.steps,
        (("step", unit), lambda one: Name(f"{level(one.from_)} → {level(one.level)}")), (("start", out), "start"),
        (("change", out), "change"), (("peak", out), "peak"),
        (("gain", f"{out}/{unit}"), "gain"),
        ("shape", lambda one: SHAPE_WORDS.get(one.shape, one.shape)), (("τ1", "s"), "tau1"), (("τ2", "s"), "tau2"),
        (("C", "", 3), "C"), (("dead time", "s", 3), "dead_time_s"), (("RMSE", out, 3), "rmse"),
        (("fit", "%", 3), "fit_pct"),
    )  # fmt: skip


def shapes_table(fit: Fit) -> Table:
    """The shapes that were tried for each step."""
    names = list(dict.fromkeys(name for one in fit.steps for name in one.evidence))
    return table_of(
        "Shapes tried for each step",
        "AICc less that of the best shape: the larger, the less it explains for what it takes. RMSE and fit: as taken.",
        fit.steps if names else (),
        (("step", fit.data.input_unit), lambda one: Name(f"{level(one.from_)} → {level(one.level)}")),
        *(((SHAPE_WORDS.get(name, name), "", 3), lambda one, name=name: one.evidence.get(name)) for name in names),
        (("RMSE", fit.data.output_unit, 3), "rmse"), (("fit", "%", 3), "fit_pct"),
    )  # fmt: skip


def held_out_table(fit: Fit) -> Table:
    """Errors on levels that were not fitted; no rows where none was held out."""
    parts = (("friction", fit.friction), ("nonlinear", fit.nonlinear), ("linear", fit.linear))
    held = [(name, part.hold_out) for name, part in parts if part is not None and part.hold_out is not None]
    out = fit.data.output_unit
    return table_of(
        "Levels held out", "Levels that the fit never saw, predicted from the others.",
        [(name, part, row) for name, part in held for row in part.levels],
        ("model", lambda one: one[0]), (("level", fit.data.input_unit), lambda one: level(one[2].level)),
        (("RMSE", out, 3), lambda one: one[2].rmse),
        (("mean |error|", out, 3), lambda one: one[2].abs_error.mean if one[2].abs_error else None),
        (("RMSE on the fitted levels", out, 3), lambda one: one[1].fitted_rmse),
    )  # fmt: skip


def model_tables(fit: Fit) -> list[Table]:
    """Values of each model, logs as recorded and single levels first."""
    found: list[Table] = []
    unit, out = fit.data.input_unit, fit.data.output_unit
    if (part := fit.recorded) is not None:
        logs = table_of(
            "Logs fitted as recorded",
            f"Free run: driven by the input alone. One step: from each measured sample to the next. {OUTSIDE}",
            part.logs,
            ("log", lambda log: Name(log.name)), ("input", "input_kind"), (("length", "s", 3), "duration_s"),
            (("rate", "Hz", 3), "rate_hz"), (("idle", out, 3), "idle"), (("RMSE", out, 3), "rmse"),
            (("free-run fit", "%", 3), "fit_pct"), (("one-step fit", "%", 3), "one_step_pct"),
            *outside(attrgetter("correlation")),
        )  # fmt: skip
        loops = table_of(
            "Closed loops as recorded", "Error: reference minus output.", part.loops,
            ("loop", lambda loop: Name(loop.name)), (("K_P", f"{unit}/({out})", 3), "K_P"),
            (("K_I", f"{unit}/({out}·s)", 3), "K_I"), (("PI law explains", "%", 3), "law_fit_pct"),
            (("at a limit", "%", 2), lambda loop: 100 * loop.saturated_fraction), (("RMS error", out, 3), "rms_error"),
        )  # fmt: skip
        kinds = table_of(
            "Kinds of lag that were tried",
            "On the same logs. Score: the squares that are left, and those that noise alone would save with as many "
            "unknowns, relative to the least.",
            fit.plant_.tried if fit.plant_ is not None else (),
            ("kind", lambda one: Name(kind_in_words(one.kind))), ("gain", "gain"), ("time constants", "lags"),
            ("unknowns", "unknowns"), (("fit", "%", 4), "fit_pct"), (("score", "", 3), "score"),
        )  # fmt: skip
        unseen = table_of(
            "Held out", "The model fitted without a part, on that part: 100 % is perfect, 0 % no better than the mean.",
            [part.hold_out] if part.hold_out is not None else [],
            ("left out", lambda one: {"logs": "each log in turn"}.get(one.of, f"the {one.of}")),
            (("fit of all that was fitted", "%", 3), "fit_pct"), (("fit of what was left out", "%", 3), "held_pct"),
        )  # fmt: skip
        found += [logs, kinds, unseen, loops]
    found.append(responses_table(fit))
    if fit.friction is not None:
        found += [levels_table(fit), *([trends_table(fit)] if fit.friction.trends else [])]
    found += [level_steps_table(fit), shapes_table(fit)]
    if fit.nonlinear is not None:
        found.append(table_iii(fit))
    if fit.linear is not None:
        found += [linear_table(fit), input_gain_table(fit)]
    release = table_of(
        "Release", "How the output falls after the input returns to zero, all levels together.",
        [fit.release] if fit.release is not None else [],
        (("τ1", "s"), "tau1"), (("τ2", "s"), "tau2"), (("RMSE", out, 3), "rmse"),
    )  # fmt: skip
    return [*found, release, held_out_table(fit)]
