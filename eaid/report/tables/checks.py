"""Every table of a fit, and those that judge it: estimates and fits side by side, and whether the model is right."""

from eaid.report.rig import gain, rate
from eaid.report.tables import fits, recorded
from eaid.report.tables.fits import PARAMETERS, estimates_of, unit_of
from eaid.report.tables.table import (
    INTERVAL,
    SYMBOLS,
    Cell,
    Head,
    Name,
    Table,
    columns,
    level,
    table_of,
    with_unit,
)
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit


def model_tables(fit: Fit, asked: bool | None = None) -> list[Table]:
    """Values of each model, logs as recorded and single levels first; tables without rows are left out."""
    found = recorded.recorded_tables(fit)
    if fit.friction is not None:
        found.append(fits.levels_table(fit))
        if fit.friction.trends:
            found.append(fits.trends_table(fit, asked))
    found.append(fits.level_steps_table(fit))
    if fit.nonlinear is not None:
        found += [fits.table_iii(fit, asked), estimates_table(fit)]
    if fit.linear is not None:
        found += [fits.linear_table(fit, asked), fits.input_gain_table(fit, asked)]
    if fit.release is not None:
        found.append(fits.release_table(fit))
    return [table for table in (*found, fits.held_out_table(fit), *fits.huber_tables(fit)) if table.rows]


def judging_tables(fit: Fit) -> list[Table]:
    """Whether the model is right, and whether another would be better; tables without rows are left out."""
    found = (lack_of_fit_table(fit), shapes_table(fit), degrees_table(fit))
    return [table for table in found if table.rows]


def estimates_table(fit: Fit) -> Table:
    """The curves of every estimate at each level; no rows where there is only one."""
    assert fit.nonlinear is not None
    shown = {name: one for name, one in estimates_of(fit.nonlinear).items() if one.curves}
    at = [{row.level: row for row in one.curves} for one in shown.values()]
    rows: list[tuple[Cell, ...]] = []
    for place in at[0] if len(at) > 1 else ():
        for name in PARAMETERS:
            said = f"{SYMBOLS[name]} ({unit_of(fit, name)})"
            cells: list[Cell] = [with_unit(level(place), fit.data.input_unit), said]
            for rows_of in at:
                row = rows_of.get(place)
                cells += [getattr(row, name), ci95_of(row, name)] if row is not None else [None, None]
            rows.append(tuple(cells))
    heads: list[Head] = ["level", "value"]
    for k, name in enumerate(shown):
        heads += [f"{name} (used)" if k == 0 else name, INTERVAL]
    return Table("Estimates side by side", "Values of each estimate at the levels.", columns(*heads), tuple(rows))


def lack_of_fit_table(fit: Fit) -> Table:
    """What each level's curve misses, against what its repeats scatter."""
    judged = fit.uncertainty.adequacy if fit.uncertainty else None
    unit, out = fit.data.input_unit, fit.data.output_unit
    rows: list[tuple[Cell, ...]] = [
        (with_unit(level(row.level), unit), row.ratio, row.chance, row.beyond, row.systematic_nm)
        for row in (judged.lack_of_fit if judged else ())
    ]
    if judged and rows:
        for said, value in (
            ("residual autocorrelation, one sample apart", judged.residual_autocorrelation),
            ("samples that count as independent", judged.effective_samples),
            (f"error on a level left out ({out})", judged.leave_one_level_out_nm),
        ):
            if value is not None:
                rows.append((said, value, None, "", None))
    caption = "The ratio is what a level's curve misses over what its repeats scatter; beyond what chance allows, the "
    caption += "curve's shape is not quite right there, by the systematic part."
    heads = columns("level", ("ratio", "", 3), ("by chance up to", "", 3), "beyond", ("systematic part", out, 2))
    return Table("Is the model right", caption, heads, tuple(rows))


def shapes_table(fit: Fit) -> Table:
    """Curves tried on each level."""
    return table_of(
        "Which shape",
        "Curves tried on each level. AICc weighs closeness against the number of values fitted: the least is best, "
        "differences below about 4 say little.",
        fit.uncertainty.adequacy.shapes if fit.uncertainty and fit.uncertainty.adequacy else (),
        ("curve", "name"), (("values a level", "", 1), "parameters"), (("RMSE", fit.data.output_unit, 3), "rmse"),
        (("AICc", "", 6), "aicc"),
    )  # fmt: skip


def degrees_table(fit: Fit) -> Table:
    """Degrees tried for each polynomial."""
    return table_of(
        "Which degree",
        "Polynomials of the input tried for each value. The last column is the typical error when a level is left out "
        "and predicted from the others.",
        fit.uncertainty.adequacy.orders if fit.uncertainty and fit.uncertainty.adequacy else (),
        ("value", lambda one: SYMBOLS.get(one.parameter, one.parameter)), (("degree", "", 1), "order"),
        ("χ²", "chi_square"), ("AICc", "aicc"), (("left-out error", "%", 3), "leave_one_out_pct"),
    )  # fmt: skip


def comparison_table(first: Fit, second: Fit, names: tuple[str, str]) -> Table:
    """Values of two fits of one kind: both, their difference, and whether the intervals part."""
    rows: list[tuple[Cell, ...]] = []

    def add(name: str, a: float | None, b: float | None, ends_a: Interval = None, ends_b: Interval = None) -> None:
        if a is None or b is None:
            return
        change = f"{100 * (b / a - 1):+.1f} %".replace("-", "−") if a else "–"
        parted = None if ends_a is None or ends_b is None else ends_a[1] < ends_b[0] or ends_b[1] < ends_a[0]
        rows.append((name, a, ends_a, b, ends_b, change, parted))

    unit, out = first.data.input_unit, first.data.output_unit
    one, two = first.linear, second.linear
    if one is not None and two is not None:
        for key, per in (("a0", "1/s"), ("b0", rate(unit, out)), ("c0", f"{out}/s")):
            ends = [ci95_of(part, key) for part in (one, two)]
            add(f"{key} ({per})", getattr(one, key), getattr(two, key), *ends)
        if one.bounds and two.bounds:
            for key in ("B_m", "B_M"):
                ends = [ci95_of(bounds, key) for bounds in (one.bounds, two.bounds)]
                add(f"{key} ({gain(unit, out)})", getattr(one.bounds, key), getattr(two.bounds, key), *ends)
    for part in ("nonlinear", "linear"):
        a, b = getattr(first, part), getattr(second, part)
        add(f"RMSE of the {part} model ({out})", a and a.rmse, b and b.rmse)
    levels = [{row.level: row for row in fit.friction_levels} for fit in (first, second)]
    for place in sorted(set(levels[0]) & set(levels[1])):
        pair = levels[0][place], levels[1][place]
        for key in PARAMETERS:
            ends = [ci95_of(row, key) for row in pair]
            said = f"{SYMBOLS[key]} at {with_unit(level(place), unit)} ({unit_of(first, key)})"
            add(said, getattr(pair[0], key), getattr(pair[1], key), *ends)
    heads = columns(
        "value", "A", ("A, 95 %", "", 3), "B", ("B, 95 %", "", 3), "change", "beyond both intervals"
    )  # fmt: skip
    return Table("Both fits", Name(f"A is {names[0]}, B is {names[1]}."), heads, tuple(rows))
