"""gains.json → the gains that the steps take; and the paper's own, Table IV and §V-B."""

import math
from collections.abc import Mapping
from typing import Any

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.errors import DataError

_SOURCE = "gains.json"


def paper_gains() -> tuple[RCGains, PIGains]:
    """Table IV (ρ with B_M φ as printed, P = 5·I, B̂ = 12.5) and the PI of 21 and 360."""
    B_m, B_M, Q_M, phi, K_P, K_D, p = 12.4, 42.6, 5.0, 0.05, 4.5, 3.0, 5.0
    alpha = (B_M - B_m) / (B_M + B_m)
    rc = RCGains(
        K_P=K_P,
        K_D=K_D,
        B_hat=12.5,
        a0=1.36,
        b0=0.08,
        c0=-2.42,
        rho_constant=(alpha * Q_M + B_M * phi) / (1 - alpha),
        rho_slope=alpha * math.hypot(K_P, K_D) / (1 - alpha),
        epsilon=0.5,
        gamma=50.0,
        Q12=p / (2 * K_P),
        Q22=(p + p / K_P) / (2 * K_D),
    )
    return rc, PIGains(K_P=21.0, K_I=360.0)


def rc_from_json(gains: Mapping[str, Any], source: str = _SOURCE) -> RCGains:
    """Gains of the robust controller from a gains.json; what is missing or not a number is a DataError."""
    model = _part(gains, "model", source)
    rc = _part(gains, "rc", source)
    rho = _part(rc, "rho", f"{source}: rc")
    Q = rc.get("Q")
    rows = Q if isinstance(Q, list | tuple) and len(Q) == 2 else [None, None]
    row = rows[1] if isinstance(rows[1], list | tuple) and len(rows[1]) == 2 else [None, None]
    low, high = _limits(gains, source)
    read = RCGains(
        K_P=_number(rc, "K_P", source),
        K_D=_number(rc, "K_D", source),
        B_hat=_number(rc, "B_hat", source),
        a0=_number(model, "a0", source),
        b0=_number(model, "b0", source),
        c0=_number(model, "c0", source),
        rho_constant=_number(rho, "constant", source),
        rho_slope=_number(rho, "slope", source),
        epsilon=_number(rc, "epsilon", source),
        gamma=_number(rc, "gamma", source),
        Q12=_number({"Q[1][0]": row[0]}, "Q[1][0]", source),
        Q22=_number({"Q[1][1]": row[1]}, "Q[1][1]", source),
        duty_min=low,
        duty_max=high,
        back_calculation=_back_calculation(rc),
    )
    for name in ("b0", "B_hat", "epsilon", "gamma", "Q22"):
        if not getattr(read, name) > 0:
            raise DataError(f"{source}: {name} is {getattr(read, name):g}, it has to be positive; run tune-rc again")
    return read


def pi_from_json(gains: Mapping[str, Any], source: str = _SOURCE) -> PIGains:
    """Gains of the PI controller from a gains.json; what is missing or not a number is a DataError."""
    pi = _part(gains, "pi", source)
    low, high = _limits(gains, source)
    return PIGains(
        K_P=_number(pi, "K_P", source),
        K_I=_number(pi, "K_I", source),
        duty_min=low,
        duty_max=high,
        back_calculation=_back_calculation(pi),
    )


def _part(gains: Mapping[str, Any], key: str, source: str) -> Mapping[str, Any]:
    part = gains.get(key)
    if not isinstance(part, Mapping):
        raise DataError(f'{source}: holds no "{key}"; make it with eaid tune-rc')
    return part


def _number(part: Mapping[str, Any], key: str, source: str) -> float:
    value = part.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise DataError(f"{source}: {key} is {value!r}, not a finite number; run tune-rc again")
    return float(value)


def _limits(gains: Mapping[str, Any], source: str) -> tuple[float, float]:
    limits = gains.get("duty_limits_pct", [0.0, 100.0])
    if not isinstance(limits, list | tuple) or len(limits) != 2:
        raise DataError(
            f"{source}: duty_limits_pct is {limits!r}, it has to be [lowest, highest] in %; run tune-rc again"
        )
    low, high = (_number({"duty_limits_pct": limit}, "duty_limits_pct", source) for limit in limits)
    if not 0.0 <= low < high:
        raise DataError(f"{source}: duty_limits_pct is {limits!r}, it has to rise from 0 or above; run tune-rc again")
    return low, high


def _back_calculation(part: Mapping[str, Any]) -> float:
    wound = part.get("anti_windup")
    if isinstance(wound, Mapping) and wound.get("method") == "back-calculation":
        return _number(wound, "gain", _SOURCE)
    return 0.0
