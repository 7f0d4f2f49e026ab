"""The models read back from a fit.json."""

from typing import Any

from eaid.errors import DataError
from eaid.models.parameters import SHARE, Linear, Nonlinear
from eaid.results.fit import NOT_IDENTIFIABLE


def _number(part: dict[str, Any], key: str, name: str) -> float:
    value = part.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"fit.json: {name}.{key} is {'missing' if value is None else 'no number'}; run eaid fit again")
    return float(value)


def _numbers(part: dict[str, Any], key: str, name: str, least: int) -> tuple[float, ...]:
    values = part.get(key)
    good = isinstance(values, list) and len(values) >= least
    if not good or any(isinstance(v, bool) or not isinstance(v, int | float) for v in values or ()):
        raise DataError(f"fit.json: {name}.{key} is no list of {least} or more numbers; run eaid fit again")
    return tuple(float(v) for v in values or ())


def _part(result: dict[str, Any], name: str) -> dict[str, Any]:
    part = result.get(name)
    if not isinstance(part, dict) or not part:
        raise DataError(f"fit.json: it holds no {name} model; run eaid fit on clutch logs with --model {name}")
    return part


def nonlinear_from_json(result: dict[str, Any]) -> Nonlinear:
    """The nonlinear model of a fit.json; its release constants where falling edges were fitted.

    Needs `nonlinear` with tau1, tau2, Ts and u_range; C is 0.85 where it is absent. Raises DataError.
    """
    part = _part(result, "nonlinear")
    lo, hi = (*_numbers(part, "u_range", "nonlinear", 2), 0.0)[:2]
    if not 0 <= lo <= hi or hi == 0:
        raise DataError(f"fit.json: nonlinear.u_range is [{lo:g}, {hi:g}]; it has to rise from 0 or above")
    release = result.get("release")
    constants = None
    if isinstance(release, dict) and release.get("tau1") is not None and release.get("tau2") is not None:
        constants = (_number(release, "tau1", "release"), _number(release, "tau2", "release"))
    return Nonlinear(
        tau1=_numbers(part, "tau1", "nonlinear", 1),
        tau2=_numbers(part, "tau2", "nonlinear", 1),
        Ts=_numbers(part, "Ts", "nonlinear", 1),
        u_range=(lo, hi),
        C=_number(part, "C", "nonlinear") if part.get("C") is not None else SHARE,
        release=constants,
    )


def linear_from_json(result: dict[str, Any]) -> Linear:
    """The pooled linear model of a fit.json. Needs `linear` with a0, b0 and c0; raises DataError."""
    part = _part(result, "linear")
    return Linear(_number(part, "a0", "linear"), _number(part, "b0", "linear"), _number(part, "c0", "linear"))


def bounds_from_json(result: dict[str, Any]) -> tuple[float, float] | None:
    """(B_m, B_M) of a fit.json [%·s/(N·m)], or None where it holds none."""
    bounds = _part(result, "linear").get("bounds")
    if not isinstance(bounds, dict) or bounds.get("B_m") is None or bounds.get("B_M") is None:
        return None
    return _number(bounds, "B_m", "linear.bounds"), _number(bounds, "B_M", "linear.bounds")


def not_identifiable_because(result: dict[str, Any], name: str) -> list[str]:
    """Why the data do not determine a model of a fit.json, as sentences."""
    found = [one for one in result.get("findings") or [] if isinstance(one, dict)]
    told = [one for one in found if one.get("subject") == name and one.get("code") in NOT_IDENTIFIABLE]
    older = (result.get(name) or {}).get("not_identifiable_because") or []
    return [str(one.get("text")) for one in told] or [str(one) for one in older] or ["no reason given"]
