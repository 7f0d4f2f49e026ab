"""What a fit is: plain data, in the units of SPEC §1."""

from dataclasses import dataclass, field
from typing import Any

from eaid.models.parameters import Friction, Linear, Nonlinear


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
