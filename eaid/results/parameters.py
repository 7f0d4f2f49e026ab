"""The one table of a fit's parameters: every value with its interval, its degrees of freedom, or why it has none."""

from collections.abc import Iterator, Sequence
from typing import Any

from eaid.findings.row import SYMBOLS
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit, Parameter

OPEN = ("parameter-constrained", "parameter-unknown-at-half-the-levels", "constraint-holds")
"""Codes of findings that name the parameter that has no interval."""
OF_ITSELF = {
    "taus-meet": ("tau1", "tau2"),
    "tau2-open": ("tau2",),
    "one-level-linear": ("c0",),
    "level-without-b": ("B",),
}
"""Codes of findings that say by themselves which parameters have none."""


def table_of(fit: Fit) -> tuple[Parameter, ...]:
    """The rows of a fit: nonlinear, linear, friction, release."""

    def row(model: str, symbol: str, place: str, value: float | None, ends: Interval, **more: Any) -> Parameter:
        low, high = ends or (None, None)
        why = "" if ends else _why(fit, model, symbol, more.get("level"))
        return Parameter(model, symbol + place, value=value, low=low, high=high, why=why, **more)

    def of(model: str, part: Any, *names: str, level: float | None = None, place: str = "") -> Iterator[Parameter]:
        """Values of a part that holds their intervals as `ci95`."""
        known = getattr(part.ci95, "dof", {})
        for name in names:
            yield row(model, name, place, getattr(part, name), ci95_of(part, name), level=level, dof=known.get(name))

    def powers(model: str, symbol: str, values: Sequence[float], ends: Sequence[Interval], **more: Any) -> None:
        for i, value in enumerate(values):
            rows.append(row(model, symbol, f"[{i}]", value, ends[i] if i < len(ends) else None, **more))

    rows: list[Parameter] = []
    if (p := fit.nonlinear) is not None:
        known = {} if p.covariance is None else p.covariance.degrees_of_freedom
        for name in ("tau1", "tau2", "Ts"):
            ends = () if p.ci95 is None else getattr(p.ci95, name)
            powers("nonlinear", name, getattr(p, name), ends, dof=known.get(name))
        rows.append(row("nonlinear", "C", "", p.C, ci95_of(p, "C")))
    if (q := fit.linear) is not None:
        rows += of("linear", q, "a0", "b0", "c0")
        for level in q.per_level:
            rows += of("linear", level, "a0", "gain", "B", level=level.level)
        if q.bounds is not None:
            rows += of("linear", q.bounds, "B_m", "B_M")
    if fit.friction is not None:
        for one in fit.friction.levels:
            names = (*SYMBOLS, *(["C_f"] if one.C_f is not None else []))
            between = f"[from {one.from_:g}]" if one.from_ else ""
            rows += of("friction", one, *names, level=one.level, place=between)
        for name, trend in fit.friction.trends.items():
            powers("friction", name, trend.coefficients, trend.ci95 or ())
    elif p is not None:
        for curve in p.curves:
            rows += of("nonlinear", curve, *SYMBOLS, level=curve.level)
    if fit.release is not None:
        rows += [row("release", name, "", getattr(fit.release, name), None) for name in ("tau1", "tau2")]
    return tuple(rows)


def _why(fit: Fit, model: str, symbol: str, level: float | None) -> str:
    """Code of the finding that says why a parameter has no interval; empty where intervals were not asked for."""
    for one in fit.findings:
        named = one.code in OPEN and one.values.get("parameter") in (symbol, None)
        about = named or symbol in OF_ITSELF.get(one.code, ())
        if about and one.subject == model and (level is None or not one.levels or level in one.levels):
            return one.code
    return ""
