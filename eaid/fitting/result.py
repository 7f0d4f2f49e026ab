"""What a fit is: plain data, in the units of SPEC §1, and the models read back from a fit.json."""

from dataclasses import dataclass, field
from typing import Any

from eaid.errors import DataError
from eaid.models.parameters import SHARE, Friction, Linear, Nonlinear


@dataclass(frozen=True, eq=False)
class Solver:
    """How a fit was found, and our own verdict on it."""

    converged: bool
    """Our verdict: the constrained Newton step promises less than a billionth of the cost, on the full data."""
    message: str
    evaluations: int
    starts: tuple[float, ...]
    """Cost at the end of every start, the best first where they were sorted; in the order tried."""
    at_bounds: tuple[str, ...]
    """The constraints that hold the end point, in words."""
    promise: float
    """What a further constrained Newton step would gain, relative to the cost."""
    method: str = "SLSQP"


@dataclass(frozen=True, eq=False)
class LevelFit:
    """The friction curve of one level, Eq. (3)."""

    level: float
    curve: Friction
    rmse: float
    """Root mean square of the residuals over the samples of the averaged repeats [N·m]."""
    sse: float
    """Sum of squared residuals over the samples of the averaged repeats [N²·m²]."""
    samples: int
    solver: Solver


@dataclass(frozen=True, eq=False)
class Trend:
    """A fitted value over stress or speed."""

    over: str
    """stress_kpa, speed_rpm, or level_UNIT where the stress is not known."""
    form: str
    """linear, double-exponential or merged-exponential."""
    coefficients: tuple[float, ...]
    """[slope, offset]; [p, r1, q, r2] of p e^(r1 x) + q e^(r2 x); [p, q, r] of (p + q x) e^(r x)."""
    rmse: float
    """[unit of the value]"""
    converged: bool = True
    at_bounds: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FrictionFit:
    """Friction curves of all levels, and their trends."""

    C: float | None
    """The share that was held; None where it was free."""
    levels: tuple[LevelFit, ...]
    trends: dict[str, Trend]
    over: str
    """What the trends run over."""
    x: tuple[float, ...]
    """The levels in that quantity."""
    C_f: tuple[float | None, ...]
    """Coefficient of friction of each level, Eq. (1); None where the output is no torque or the stress unknown."""
    solver: Solver
    warnings: tuple[str, ...] = ()
    hold_out: dict[str, Any] | None = None
    robust: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class LevelError:
    """How far a model is from one level's averaged repeats."""

    level: float
    rmse: float
    sse: float
    abs_mean: float
    abs_sd: float


@dataclass(frozen=True, eq=False)
class NonlinearFit:
    """The ten coefficients of Eqs. (4)–(7)."""

    parameters: Nonlinear
    rmse: float
    sse: float
    abs_mean: float
    """Mean of |residual| over all samples [N·m]."""
    abs_sd: float
    """Standard deviation of |residual| over all samples [N·m]."""
    per_level: tuple[LevelError, ...]
    solver: Solver
    share_free: bool = False
    weights: tuple[float, ...] | None = None
    """Weight of each level; None: all alike."""
    robust: dict[str, Any] | None = None
    """Huber's scale and weights, where that loss was asked for."""
    warnings: tuple[str, ...] = ()
    hold_out: dict[str, Any] | None = None
    other: "NonlinearFit | None" = None
    """The same model under the weights that were not asked for."""
    no_other: str | None = None
    """Why there is none, in words."""


@dataclass(frozen=True, eq=False)
class LinearLevel:
    """Eq. (8) fitted to one level: what one step can tell is a0 and the gain (b0 u + c0)/a0; b0 by convention."""

    level: float
    a0: float
    gain: float
    """Steady torque of the level's own fit [N·m]."""
    b0: float
    c0: float
    B: float | None
    """1/b0 [%·s/(N·m)]; None where b0 is not positive."""
    rmse: float
    sse: float
    solver: Solver


@dataclass(frozen=True, eq=False)
class Bounds:
    """Least and largest B over the levels that the user keeps."""

    convention: str
    levels: tuple[float, ...]
    B_m: float | None
    B_M: float | None


@dataclass(frozen=True, eq=False)
class PooledLinear:
    """Eq. (8) fitted to all levels at once, under other weights."""

    parameters: Linear
    rmse: float
    sse: float
    solver: Solver
    weights: tuple[float, ...] | None
    """Weight of each level; None: all alike."""


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Eq. (8) fitted to all levels at once, and to each."""

    parameters: Linear
    rmse: float
    sse: float
    per_level: tuple[LinearLevel, ...]
    """Under the chosen convention."""
    bounds: Bounds
    conventions: dict[str, Bounds]
    """The bounds under each of the three conventions."""
    solver: Solver
    weights: tuple[float, ...] | None = None
    robust: dict[str, Any] | None = None
    warnings: tuple[str, ...] = ()
    hold_out: dict[str, Any] | None = None
    other: PooledLinear | None = None
    """The pooled model under the weights that were not asked for."""
    no_other: str | None = None
    """Why there is none, in words."""


@dataclass(frozen=True, eq=False)
class ReleaseLevel:
    """T(t) = residual + amplitude (share e^(−t/τ1) + (1 − share) e^(−t/τ2)) after the release of one level."""

    level: float
    share: float
    """The fast state's part of the torque at the instant of release."""
    tau1: float
    tau2: float
    amplitude: float
    """Torque that decays [N·m]."""
    residual: float
    """Torque left after a long time [N·m]."""
    rmse: float
    sse: float
    solver: Solver
    rising_tau1: float | None = None
    rising_tau2: float | None = None


@dataclass(frozen=True, eq=False)
class ReleaseFit:
    """Time constants of the falling edges: pooled over all levels, and of each."""

    C: float
    tau1: float
    tau2: float
    rmse: float
    sse: float
    levels: tuple[ReleaseLevel, ...]
    solver: Solver
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Fit:
    """All that one call fitted; what its kind does not allow is None."""

    friction: FrictionFit | None = None
    nonlinear: NonlinearFit | None = None
    linear: LinearFit | None = None
    release: ReleaseFit | None = None
    warnings: tuple[str, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """Whether every model that was fitted passed our verdict."""
        parts = (self.friction, self.nonlinear, self.linear, self.release)
        return all(part.solver.converged for part in parts if part is not None)


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
