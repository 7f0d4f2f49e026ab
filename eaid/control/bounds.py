"""The linear part of a fit.json → the model and the range of B that a design rests on.

B_i of a level is 1/b0_i. One step cannot tell b0 from c0, so three conventions (`linear.bounds` names the fit's own):

    zero-offset      b0_i = a_i gain_i / u_i                  c0 = 0, a0 free
    pooled-offset    b0_i = (a_i gain_i − c0)/u_i             c0 from the pooled fit, a0 free
    pooled-dynamics  a0 and c0 from the pooled fit            (needs the fit made with it: the gain is another)
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eaid.errors import DataError, GainsError, UsageError
from eaid.models.parameters import Linear
from eaid.steps.levels import wanted_levels

CONVENTIONS = ("zero-offset", "pooled-offset", "pooled-dynamics")


@dataclass(frozen=True)
class Bounds:
    """The range of B and where it comes from."""

    convention: str
    levels: tuple[float, ...]
    B_m: float
    """[%·s/(N·m)]"""
    B_M: float
    """[%·s/(N·m)]"""
    rows: tuple[dict[str, float], ...]
    """level, a0, c0, gain, B of the levels kept; empty where the fit holds none."""


def model_of(fit: Mapping[str, Any], source: str) -> Linear:
    """The pooled linear model; DataError where it is missing, GainsError where it is not physical."""
    linear = fit.get("linear")
    if not isinstance(linear, Mapping):
        raise DataError(f"{source}: holds no linear model; fit clutch data with --model linear (or all models)")
    a0, b0, c0 = (_number(linear, key, f"{source}: linear") for key in ("a0", "b0", "c0"))
    if not a0 > 0:
        raise GainsError(
            f"{source}: a0 is {a0:.4g} 1/s; a clutch whose torque does not settle by itself is not physical"
        )
    if not b0 > 0:
        raise GainsError(
            f"{source}: b0 is {b0:.4g} N·m/(s·%); more duty has to give more torque, check the sign of the data"
        )
    return Linear(a0, b0, c0)


def bounds_of(
    fit: Mapping[str, Any], source: str, convention: str | None, levels: str | None, widen: bool = False
) -> Bounds:
    """B_m and B_M as fitted, or over other levels (`30:100`, `30,40`) or by another convention from the single levels.

    `widen` takes the far ends of the levels' 95 % intervals. A range that is not positive is refused (GainsError).
    """
    model = model_of(fit, source)
    linear = fit["linear"]
    stored = linear.get("bounds") or {}
    own = str(stored.get("convention", "zero-offset"))
    wanted = convention or own
    if wanted not in CONVENTIONS:
        raise UsageError(f"--bounds {wanted}: must be one of {', '.join(CONVENTIONS)}")
    rows = [row for row in linear.get("per_level") or [] if isinstance(row, Mapping)]
    ready = (linear.get("conventions") or {}).get(wanted)
    if wanted != own and levels is None and not widen and isinstance(ready, Mapping):
        kept, found = [float(level) for level in ready.get("levels") or []], []
        if "pooled-dynamics" not in (own, wanted):
            found = [row for row in _under(rows, model, own, wanted, source) if row["level"] in kept]
        B_m, B_M = ready.get("B_m"), ready.get("B_M")
    elif wanted == own and levels is None and not widen and "B_m" in stored:
        kept = [float(level) for level in stored.get("levels") or [row["level"] for row in rows]]
        found = [row for row in _under(rows, model, own, own, source) if row["level"] in kept]
        B_m, B_M = stored["B_m"], stored.get("B_M")
    else:
        if not rows:
            raise UsageError(
                f"{source}: holds no fits of single levels, so --bounds, --levels and --widen-bounds have nothing to "
                "work on; fit again with this version of eaid"
            )
        found = _under(rows, model, own, wanted, source)
        kept = wanted_levels(levels, [row["level"] for row in found]) if levels else list(stored.get("levels") or [])
        kept = kept or [row["level"] for row in found]
        found = [row for row in found if row["level"] in kept]
        ends = [_interval(row, rows, source) if widen else (row["B"], row["B"]) for row in found]
        B_m, B_M = min(low for low, _ in ends), max(high for _, high in ends)
    checked = [_positive(value, name, source) for value, name in ((B_m, "B_m"), (B_M, "B_M"))]
    if checked[1] < checked[0]:
        raise GainsError(f"{source}: B_m {checked[0]:.4g} lies above B_M {checked[1]:.4g}; check linear.bounds")
    if any(not (row["B"] > 0 and math.isfinite(row["B"])) for row in found):
        raise GainsError(
            f"{source}: a level has no positive b0, so the range of B touches 0; leave it out with --levels"
        )
    return Bounds(wanted, tuple(kept), checked[0], checked[1], tuple(found))


def _under(
    rows: Sequence[Mapping[str, Any]], model: Linear, own: str, wanted: str, source: str
) -> list[dict[str, float]]:
    if wanted != own and "pooled-dynamics" in (own, wanted):
        raise UsageError(
            f"{source}: was fitted with --bounds {own}; {wanted} needs other fits of the single levels, "
            f"so fit again with --bounds {wanted}"
        )
    found = []
    for row in rows:
        level, a0, gain = (_number(row, key, f"{source}: linear.per_level") for key in ("level", "a0", "gain"))
        c0 = 0.0 if wanted == "zero-offset" else model.c0
        if level == 0:
            continue
        b0 = (a0 * gain - c0) / level
        found.append({"level": level, "a0": a0, "c0": c0, "gain": gain, "B": 1 / b0 if b0 else math.inf})
    return found


def _interval(row: Mapping[str, float], rows: Sequence[Mapping[str, Any]], source: str) -> tuple[float, float]:
    """The 95 % interval of a level's B, scaled where the convention is another than the fit's."""
    stored = next(r for r in rows if r["level"] == row["level"])
    ends = (stored.get("ci95") or {}).get("B")
    value = stored.get("B")
    if not isinstance(ends, list | tuple) or len(ends) != 2 or None in ends or not value:
        raise UsageError(
            f"{source}: level {row['level']:g} has no interval of B, so --widen-bounds has nothing to widen by; "
            "fit again with --ci robust, or leave the level out with --levels"
        )
    return row["B"] * float(ends[0]) / float(value), row["B"] * float(ends[1]) / float(value)


def _positive(value: Any, name: str, source: str) -> float:
    if isinstance(value, int | float) and math.isfinite(value) and value > 0:
        return float(value)
    shown = f"{value:.4g}" if isinstance(value, int | float) else "missing"
    raise GainsError(
        f"{source}: {name} is {shown}, so the range of B touches 0 and no gain is robust over it; "
        "leave out the levels without a positive b0 (--levels)"
    )


def _number(part: Mapping[str, Any], key: str, source: str) -> float:
    value = part.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise DataError(f"{source}: {key} is {value!r}, not a finite number; fit again")
    return float(value)
