"""Tables that lay estimates of one model side by side, and what Huber's loss weighed down."""

from collections.abc import Mapping
from typing import Any

from eaid.fitting.side_by_side import advice, linear_estimates, nonlinear_estimates
from eaid.report.tables import SYMBOLS, UNITS, Table, interval, level, number, unit_of_input, unit_of_output


def estimates(content: Mapping[str, Any]) -> list[Table]:
    """The curves of every estimate of the nonlinear model at each level, and both weights of the linear one."""
    found = []
    unit, out = unit_of_input(content), unit_of_output(content)
    if part := content.get("nonlinear"):
        shown = {name: one for name, one in nonlinear_estimates(part).items() if one.get("curves")}
        if len(shown) > 1:
            found.append(_curves(part, shown, unit, out))
    if part := content.get("linear"):
        both = linear_estimates(part)
        if len(both) > 1:
            found.append(_linear(part, both, unit, out))
    return found


def _curves(part: Mapping[str, Any], shown: Mapping[str, Mapping[str, Any]], unit: str, out: str) -> Table:
    names = list(shown)
    at = [{row["level"]: row for row in one["curves"]} for one in shown.values()]
    rows = []
    for place in at[0]:
        for name in ("Ts", "tau1", "tau2"):
            cells = [f"{level(place)} {unit}".rstrip(), f"{SYMBOLS[name]} ({out if name == 'Ts' else UNITS[name]})"]
            for rows_of in at:
                row = rows_of.get(place) or {}
                cells += [number(row.get(name)), interval((row.get("ci95") or {}).get(name))]
            rows.append(tuple(cells))
    columns = ["level", "value"]
    for k, name in enumerate(names):
        columns += [f"{name} (used)" if k == 0 else name, "95 % interval"]
    caption = "The curves of each estimate at the levels. " + " ".join(advice(part))
    return Table("Estimates side by side", caption, tuple(columns), tuple(rows))


def _linear(part: Mapping[str, Any], both: Mapping[str, Mapping[str, Any]], unit: str, out: str) -> Table:
    units = {"a0": "1/s", "b0": f"{out}/(s·{unit or 'input'})", "c0": f"{out}/s"}
    rows = []
    for name, said in units.items():
        cells = [f"{name} ({said})"]
        for one in both.values():
            cells += [number(one.get(name)), interval((one.get("ci95") or {}).get(name))]
        rows.append(tuple(cells))
    rows.append((f"RMSE ({out})", *(cell for one in both.values() for cell in (number(one.get("rmse"), 3), ""))))
    columns = ["value"]
    for k, name in enumerate(both):
        columns += [f"{name} (used)" if k == 0 else name, "95 % interval"]
    return Table("Linear model under both weights", " ".join(advice(part)), tuple(columns), tuple(rows))


def huber(content: Mapping[str, Any]) -> list[Table]:
    """How much of each level Huber's loss held back, and where; one table a model."""
    found = []
    unit = unit_of_input(content)
    for name in ("friction", "nonlinear", "linear"):
        part = content.get(name) or {}
        told = part.get("robust") or (part.get("joint") or {}).get("robust")
        if not told:
            continue
        rows = tuple(
            (
                f"{level(row.get('level'))} {unit}".rstrip(),
                number(100 * row["below_one"], 2) if row.get("below_one") is not None else "–",
                number(row.get("mean"), 3),
                number(row.get("least"), 3),
                "; ".join(_part(one) for one in row.get("parts") or []) or "none",
            )
            for row in told.get("weights") or []
        )
        caption = (
            f"Residuals beyond {number(told.get('k'))} σ count less, as 1/|residual|; σ by the median is "
            f"{number(told.get('sigma'), 3)}. Normal noise alone holds back 18 % of the samples, none "
            "of them below half its weight for long."
        )
        columns = ("level", "samples held back (%)", "mean weight", "least weight", "parts that count less than half")
        found.append(Table(f"Weights of Huber's loss, {name} model", caption, columns, rows, formulas=False))
    return found


def _part(one: Mapping[str, Any]) -> str:
    run = f", {one['run']}" if one.get("run") else ""
    return (
        f"{number(one.get('from_s'), 3)} to {number(one.get('to_s'), 3)} s (down to {number(one.get('least'), 2)}{run})"
    )
