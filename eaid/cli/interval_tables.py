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
    joint = part.get("joint") or part
    both = part if "joint" in part else part.get("two_stage") or {}
    _curves(f"{way}: the curves of both estimates", {"joint": joint, "two-stage": both})
    other = joint.get("other_weights") or {}
    names = ("sd", "equal") if "weights" in joint else ("equal", "sd")
    _curves(f"{way}: the curves under both weights", dict(zip(names, (joint, other), strict=True)))
    linear = result.get("linear") or {}
    if linear.get("ci95"):
        rows = [[name, f"{linear[name]:.5g}", _ends(ends)] for name, ends in linear["ci95"].items()]
        other = linear.get("other_weights") or {}
        rows += [
            [f"{name}, {other['weights']} weights", f"{other[name]:.5g}", _ends(ends)]
            for name, ends in other.get("ci95", {}).items()
        ]
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


def _curves(title: str, estimates: dict[str, dict[str, Any]]) -> None:
    """T_s, τ1, τ2 at each level by two estimates with their intervals; nothing where one has none."""
    first, second = (estimate.get("curves") for estimate in estimates.values())
    if not first or not second:
        return
    rows = [
        [f"{one['level']:g}", *(_span(row, name) for name in ("Ts", "tau1", "tau2") for row in (one, two))]
        for one, two in zip(first, second, strict=True)
    ]
    console.table(title, ["level", *(f"{name}, {way}" for name in ("T_s", "τ1", "τ2") for way in estimates)], rows)


def _span(row: dict[str, Any], name: str) -> str:
    return _ends((row.get("ci95") or {}).get(name))


def _ends(interval: list[float] | None) -> str:
    return "not determined" if not interval else f"{interval[0]:.4g} … {interval[1]:.4g}"
