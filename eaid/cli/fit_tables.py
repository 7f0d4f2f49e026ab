"""The tables of `eaid fit`: each model's numbers as they stand in fit.json, the other estimates beside them."""

from collections.abc import Mapping
from typing import Any

from eaid.cli import console
from eaid.fitting.side_by_side import linear_estimates, nonlinear_estimates


def tables(result: dict[str, Any]) -> None:
    """The body of a fit.json for people, one short table a model."""
    unit, out = result["data"]["input_unit"] or "input", result["data"]["output_unit"] or "output"
    for name, show in TABLES.items():
        if name in result:
            show(result[name], unit, out)


def verdict_cell(solver: Mapping[str, Any]) -> str:
    """The verdict for a table."""
    if not solver["converged"]:
        return "NOT CONVERGED"
    return "converged, at a constraint" if solver["at_bounds"] else "converged"


def friction_table(part: dict[str, Any], unit: str, out: str) -> None:
    """T_s, τ1, τ2 of each level, and the trends."""
    rows = [
        [
            f"{row['level']:g}", f"{row['Ts']:.5g}", f"{row['tau1']:.4g}", f"{row['tau2']:.4g}", f"{row['C']:.3g}",
            _number(row.get("C_f")), f"{row['rmse']:.3g}", verdict_cell(row["solver"]),
        ]
        for row in part["levels"]
    ]  # fmt: skip
    columns = [f"level [{unit}]", f"T_s [{out}]", "τ1 [s]", "τ2 [s]", "C", "C_f", f"RMSE [{out}]", "verdict"]
    console.table("Friction curve of each level, Eq. (3)", columns, rows)
    if part["trends"]:
        rows = [
            [name, row["over"], row["form"], ", ".join(f"{c:.5g}" for c in row["coefficients"]), f"{row['rmse']:.3g}"]
            for name, row in part["trends"].items()
        ]
        console.table("Trends", ["value", "over", "form", "coefficients", "RMSE"], rows)
    huber_table("friction curves", part, unit)


def nonlinear_table(part: dict[str, Any], unit: str, out: str) -> None:
    """The coefficients, lowest power first: of the estimate that is used, and of the others beside it."""
    shown = _heads(nonlinear_estimates(part))
    rows = [
        [name, what, *(", ".join(f"{c:.6g}" for c in values(one)) for one in shown.values())]
        for name, what, values in (
            ("τ1(u)", "s", lambda one: one["tau1"]),
            ("τ2(u)", "s", lambda one: one["tau2"]),
            ("T_s(u)", out, lambda one: one["Ts"]),
            ("C", "1", lambda one: [one["C"]]),
            ("u", unit, lambda one: one["u_range"]),
            ("RMSE", out, lambda one: [one["rmse"]]),
            ("|error|, mean and sd", out, lambda one: [one["abs_error"]["mean"], one["abs_error"]["sd"]]),
        )
    ]
    if "hold_out" in part:
        cells = [f"{one['hold_out']['rmse']:.6g}" if "hold_out" in one else "-" for one in shown.values()]
        rows.append(["RMSE on held-out levels", out, *cells])
    rows.append(["verdict", "", *(verdict_cell(one["solver"]) for one in shown.values())])
    title = "Nonlinear model, Eqs. (4)–(7); polynomials lowest power first"
    console.table(title, ["", "unit", *shown], rows)
    _no_other(part.get("joint") or part)
    huber_table("nonlinear model", part.get("joint") or part, unit)


def linear_table(part: dict[str, Any], unit: str, out: str) -> None:
    """a0, b0, c0 under both weights, and the bounds of B."""
    b = part["bounds"]
    shown = _heads(linear_estimates(part))
    rows = [
        [name, what, *(f"{one[name]:.6g}" for one in shown.values())]
        for name, what in (("a0", "1/s"), ("b0", f"{out}/(s·{unit})"), ("c0", f"{out}/s"))
    ]
    rows.append(["RMSE", out, *(f"{one['rmse']:.6g}" for one in shown.values())])
    blank = [""] * (len(shown) - 1)
    if "hold_out" in part:
        rows.append(["RMSE on held-out levels", out, f"{part['hold_out']['rmse']:.6g}", *blank])
    bounds = f"{_number(b['B_m'])} … {_number(b['B_M'])} ({b['convention']})"
    rows.append(["B_m … B_M", f"{unit}·s/({out})", bounds, *blank])
    rows.append(["verdict", "", *(verdict_cell(one["solver"]) for one in shown.values())])
    console.table("Linear model, Eq. (8), all levels at once", ["", "unit", *shown], rows)
    _no_other(part)
    huber_table("linear model", part, unit)
    rows = [
        [
            f"{r['level']:g}", f"{r['a0']:.5g}", f"{r['gain']:.5g}", f"{r['b0']:.4g}", _number(r["B"]),
            f"{r['rmse']:.3g}",
        ]
        for r in part["per_level"]
    ]  # fmt: skip
    columns = [f"level [{unit}]", "a0 [1/s]", f"gain [{out}]", "b0", "B", f"RMSE [{out}]"]
    console.table(f"Linear model of each level ({b['convention']})", columns, rows)


def _heads(found: dict[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """The estimates by the heads of their columns: the first is the one that is used."""
    return {f"{name} (used)" if k == 0 else name: one for k, (name, one) in enumerate(found.items())}


def _no_other(part: dict[str, Any]) -> None:
    """Why no other weights stand beside a fit, as a line under its table."""
    if word := (part.get("other_weights") or {}).get("absent"):
        console.line(f"the other weights: {word}")


def huber_table(model: str, part: dict[str, Any], unit: str) -> None:
    """How much each level, and which parts of it, Huber's loss held back; nothing under squares."""
    told = part.get("robust")
    if not told:
        return
    rows = [
        [
            f"{row['level']:g}", f"{100 * row['below_one']:.2g} %", f"{row['mean']:.3f}", f"{row['least']:.3g}",
            "; ".join(part_words(one) for one in row["parts"]) or "-",
        ]
        for row in told["weights"]
    ]  # fmt: skip
    title = f"Weights of Huber's loss, {model} (σ = {told['sigma']:.3g}; a normal record holds back 18 %)"
    columns = [f"level [{unit}]", "samples held back", "mean weight", "least", "parts that count less than half"]
    console.table(title, columns, rows)


def part_words(one: dict[str, Any]) -> str:
    """A stretch of low weight: its times and its least weight, with the run that stands out."""
    run = f", {one['run']}" if one.get("run") else ""
    return f"{one['from_s']:.3g}–{one['to_s']:.3g} s (down to {one['least']:.2g}{run})"


def release_table(part: dict[str, Any], unit: str, out: str) -> None:
    """Falling beside rising time constants."""
    rows = [
        [
            f"{r['level']:g}", f"{r['tau1']:.4g}", _number(r["rising_tau1"]), f"{r['tau2']:.4g}",
            _number(r["rising_tau2"]), f"{r['residual']:.3g}", f"{r['rmse']:.3g}",
        ]
        for r in part["levels"]
    ]  # fmt: skip
    rows.append(["all", f"{part['tau1']:.4g}", "-", f"{part['tau2']:.4g}", "-", "-", f"{part['rmse']:.3g}"])
    columns = [
        f"level [{unit}]", "τ1 falling [s]", "τ1 rising [s]", "τ2 falling [s]", "τ2 rising [s]", f"left [{out}]",
        f"RMSE [{out}]",
    ]  # fmt: skip
    console.table("Release, beside the rise", columns, rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


TABLES = {
    "friction": friction_table,
    "nonlinear": nonlinear_table,
    "linear": linear_table,
    "release": release_table,
}
"""The tables by the parts of fit.json, in the order of printing."""
