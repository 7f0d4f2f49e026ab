"""The one table of a fit's parameters: every value with its interval, its degrees of freedom, or why it has none."""

from collections.abc import Iterator

import msgspec

from eaid.results.common import Interval
from eaid.results.fit import Fit, Parameter

CURVES = ("Ts", "tau1", "tau2")
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
    return tuple(_rows(fit))


def _rows(fit: Fit) -> Iterator[Parameter]:
    if (p := fit.nonlinear) is not None:
        known = {} if p.covariance is None else p.covariance.degrees_of_freedom
        for name in ("tau1", "tau2", "Ts"):
            ends = getattr(p.ci95, name) if p.ci95 is not None else ()
            for i, value in enumerate(getattr(p, name)):
                interval = ends[i] if i < len(ends) else None
                yield _row(fit, "nonlinear", name, f"{name}[{i}]", None, value, interval, known.get(name))
        yield _row(fit, "nonlinear", "C", "C", None, p.C, None if p.ci95 is None else p.ci95.C, None)
    if (q := fit.linear) is not None:
        for name in ("a0", "b0", "c0"):
            yield _of(fit, "linear", name, None, q)
        for row in q.per_level:
            for name in ("a0", "gain", "B"):
                yield _of(fit, "linear", name, row.level, row)
        if q.bounds is not None:
            for name in ("B_m", "B_M"):
                yield _of(fit, "linear", name, None, q.bounds)
    if fit.friction is not None:
        for level in fit.friction.levels:
            for name in (*CURVES, *(["C_f"] if level.C_f is not None else [])):
                one = _of(fit, "friction", name, level.level, level)
                between = f"{name}[from {level.from_:g}]" if level.from_ else name
                yield msgspec.structs.replace(one, name=between)
        for name, trend in fit.friction.trends.items():
            for i, value in enumerate(trend.coefficients):
                interval = trend.ci95[i] if trend.ci95 is not None else None
                yield _row(fit, "friction", name, f"{name}[{i}]", None, value, interval, None)
    elif p is not None:
        for curve in p.curves:
            for name in CURVES:
                yield _of(fit, "nonlinear", name, curve.level, curve)
    if fit.release is not None:
        for name in ("tau1", "tau2"):
            yield _row(fit, "release", name, name, None, getattr(fit.release, name), None, None)


def _of(fit: Fit, model: str, name: str, level: float | None, part: object) -> Parameter:
    """A value of a part that holds its intervals as `ci95`."""
    ci95 = getattr(part, "ci95", None)
    ends = None if ci95 is None else getattr(ci95, name)
    dof = None if ci95 is None else getattr(ci95, "dof", {}).get(name)
    return _row(fit, model, name, name, level, getattr(part, name), ends, dof)


def _row(
    fit: Fit,
    model: str,
    symbol: str,
    name: str,
    level: float | None,
    value: float | None,
    ends: Interval,
    dof: float | None,
) -> Parameter:
    low, high = ends or (None, None)
    return Parameter(model, name, level, value, low, high, dof, "" if ends else _why(fit, model, symbol, level))


def _why(fit: Fit, model: str, symbol: str, level: float | None) -> str:
    """Code of the finding that says why a parameter has no interval; empty where intervals were not asked for."""
    for one in fit.findings:
        named = one.code in OPEN and one.values.get("parameter") in (symbol, None)
        about = named or symbol in OF_ITSELF.get(one.code, ())
        if about and one.subject == model and (level is None or not one.levels or level in one.levels):
            return one.code
    return ""
