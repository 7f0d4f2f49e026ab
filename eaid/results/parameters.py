"""The one table of a fit's parameters: every value with its interval, its degrees of freedom, or why it has none."""

from collections.abc import Iterator, Sequence
from typing import Any

from eaid.findings.row import SYMBOLS
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit, Parameter
from eaid.results.plant import LAGS

OPEN_CODES = ("parameter-constrained", "parameter-unknown-at-half-the-levels", "constraint-holds")
"""Codes of findings that name the parameter that has no interval."""
OF_ITSELF = {
    "taus-meet": ("tau1", "tau2"),
    "tau2-open": ("tau2",),
    "one-level-linear": ("c0",),
    "level-without-b": ("B",),
}
"""Codes of findings that say by themselves which parameters have none."""


Known = tuple[str, str, str, float | None, Interval, dict[str, Any]]
"""Model, symbol, place, value, interval, and the further fields of a row."""


def parameters_of(fit: Fit) -> tuple[Parameter, ...]:
    """The rows of a fit: its plant where that is no nonlinear model, nonlinear, linear, friction, release."""
    rows = []
    for model, symbol, place, value, ends, more in (*_plant(fit), *_of_curves(fit), *_pooled(fit), *_levels(fit)):
        low, high = ends or (None, None)
        why = "" if ends else _why(fit, model, symbol, more.get("level"))
        rows.append(Parameter(model, symbol + place, value=value, low=low, high=high, why=why, **more))
    return tuple(rows)


def _plant(fit: Fit) -> Iterator[Known]:
    """What a plant of another kind is known by."""
    if fit.nonlinear is None and (part := fit.another_plant) is not None:
        for name, (value, ends) in part.numbers.items():
            if not (part.paced and name in LAGS):
                yield "plant", name, "", value, ends, {}
                continue
            for u in [row[0] for row in part.ci95.levels[name]] if part.ci95 is not None else part.u_range:
                yield "plant", name, "", *part.at(u)[name], {"level": u}


def _of_curves(fit: Fit) -> Iterator[Known]:
    """Curves over the input, and the share."""
    if (p := fit.nonlinear) is None:
        return
    known = {} if p.covariance is None else p.covariance.degrees_of_freedom
    for name in ("tau1", "tau2") if p.Ts_through else ("tau1", "tau2", "Ts"):  # the levels' own are the levels' rows
        ends = () if p.ci95 is None else getattr(p.ci95, name)
        yield from _powers("nonlinear", name, getattr(p, name), ends, dof=known.get(name))
    yield "nonlinear", "C", "", p.C, ci95_of(p, "C"), {}


def _pooled(fit: Fit) -> Iterator[Known]:
    """The mean, the levels, the bounds of B."""
    if (q := fit.linear) is None:
        return
    yield from _rows("linear", q, "a0", "b0", "c0")
    for level in q.per_level:
        yield from _rows("linear", level, "a0", "gain", "B", level=level.level)
    if q.bounds is not None:
        yield from _rows("linear", q.bounds, "B_m", "B_M")


def _levels(fit: Fit) -> Iterator[Known]:
    """Levels and trends of friction, or the levels of the nonlinear model; the release."""
    if fit.friction is not None:
        for one in fit.friction.levels:
            names = (*SYMBOLS, *(["C_f"] if one.C_f is not None else []))
            between = f"[from {one.from_:g}]" if one.from_ else ""
            yield from _rows("friction", one, *names, level=one.level, place=between)
        for name, trend in fit.friction.trends.items():
            yield from _powers("friction", name, trend.coefficients, trend.ci95 or ())
    elif fit.nonlinear is not None:
        for curve in fit.nonlinear.curves:
            yield from _rows("nonlinear", curve, *SYMBOLS, level=curve.level)
    if fit.release is not None:
        for name in ("tau1", "tau2"):
            yield "release", name, "", getattr(fit.release, name), None, {}


def _rows(model: str, part: Any, *names: str, level: float | None = None, place: str = "") -> Iterator[Known]:
    """Values of a part that holds their intervals as `ci95`."""
    known = getattr(part.ci95, "dof", {})
    for name in names:
        yield model, name, place, getattr(part, name), ci95_of(part, name), {"level": level, "dof": known.get(name)}


def _powers(model: str, symbol: str, values: Sequence[float], ends: Sequence[Interval], **more: Any) -> Iterator[Known]:
    """Coefficients, lowest power first."""
    for i, value in enumerate(values):
        yield model, symbol, f"[{i}]", value, ends[i] if i < len(ends) else None, more


def _why(fit: Fit, model: str, symbol: str, level: float | None) -> str:
    """Code of the finding that says why a parameter has no interval; empty where intervals were not asked for."""
    for one in fit.findings:
        named = one.code in OPEN_CODES and one.values.get("parameter") in (symbol, None)
        about = named or symbol in OF_ITSELF.get(one.code, ())
        if about and one.subject == model and (level is None or not one.levels or level in one.levels):
            return one.code
    return ""
