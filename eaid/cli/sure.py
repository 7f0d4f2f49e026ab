"""The tables of `eaid fit` that say how sure its numbers are."""

from typing import Any

from eaid.cli import console


def interval_tables(result: dict[str, Any]) -> None:
    """95 % intervals of the levels, the two estimates' curves and the linear model, and what is recommended."""
    said = result.get("uncertainty") or {}
    way = f"95 % intervals ({said.get('ci')}; scatter from {said.get('scatter_from')})"
    levels = [row for row in (result.get("friction") or {}).get("levels", []) if row.get("ci95")]
    if levels:
        rows = [[f"{row['level']:g}", *(_span(row, name) for name in ("Ts", "tau1", "tau2"))] for row in levels]
        console.table(f"{way}: each level", ["level", "T_s", "τ1 [s]", "τ2 [s]"], rows)
    part = result.get("nonlinear") or {}
    both = part.get("two_stage") or part.get("joint") or {}
    other = "two-stage" if "two_stage" in part else "joint"
    if part.get("curves") and both.get("curves"):
        own = "joint" if other == "two-stage" else "two-stage"
        rows = [
            [f"{one['level']:g}", *(_span(row, name) for name in ("Ts", "tau1", "tau2") for row in (one, two))]
            for one, two in zip(part["curves"], both["curves"], strict=True)
        ]
        columns = ["level", *(f"{name}, {which}" for name in ("T_s", "τ1", "τ2") for which in (own, other))]
        console.table(f"{way}: the curves of both estimates", columns, rows)
    linear = result.get("linear") or {}
    if linear.get("ci95"):
        rows = [[name, f"{linear[name]:.5g}", _ends(ends)] for name, ends in linear["ci95"].items()]
        bounds = linear["bounds"]
        rows += [
            [name, f"{bounds[name]:.4g}", _ends(ends)]
            for name, ends in bounds.get("ci95", {}).items()
            if bounds.get(name) is not None
        ]
        console.table(f"{way}: linear model", ["", "value", "interval"], rows)
    advice = (said.get("adequacy") or {}).get("recommended")
    if advice:
        console.table("Is the model right?", ["recommended"], [[advice]])


def _span(row: dict[str, Any], name: str) -> str:
    return _ends((row.get("ci95") or {}).get(name))


def _ends(interval: list[float] | None) -> str:
    return "not determined" if not interval else f"{interval[0]:.4g} … {interval[1]:.4g}"
