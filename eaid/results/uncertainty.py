"""The uncertainty part of fit.json: where intervals come from, and whether the model is right."""

from typing import Annotated

import msgspec

from eaid.results.common import Count, Interval, Number, Result
from eaid.results.nonlinear import CurveLevel


class Noise(Result, frozen=True):
    """What drawn runs and planned recordings rest on."""

    sensor_nm2_s: Annotated[float, msgspec.Meta(ge=0, le=1e60)] = 0.0
    """Density of the sensor's noise [output²·s]."""
    ripple_s: Annotated[float, msgspec.Meta(ge=0, le=1e60)] = 0.0
    """Density of the ripple relative to the output [s]."""
    scatter: dict[str, Number] = {}
    """Standard deviation from run to run of T_s, τ1, τ2, as a share."""


class ShareEstimate(Result, frozen=True):
    """The share C that was held, and the one that the runs ask for."""

    held: Number | None = None
    change_per_001_pct: dict[str, Number] = msgspec.field(default_factory=dict, name="per_0.01_pct")
    """Change of T_s, τ1, τ2 [%] if C were larger by 0.01."""
    estimate: Number | None = None
    ci95: Interval = None
    degrees_of_freedom: Number | None = None
    rejected: bool | None = None
    matters: bool | None = None
    levels_differ: bool | None = None
    at_estimate: tuple[CurveLevel, ...] = ()


class ShapeScore(Result, frozen=True):
    """One curve shape, fitted to every level."""

    name: str
    parameters: Count = 0
    rmse: Number | None = None
    aicc: Number | None = None
    bic: Number | None = None


class OrderScore(Result, frozen=True):
    """One polynomial order of one parameter."""

    parameter: str
    order: Count = 0
    chi_square: Number | None = None
    aicc: Number | None = None
    leave_one_out_pct: Number | None = None


class LackOfFit(Result, frozen=True):
    """A level's misfit against the spread of its repeats."""

    level: Number
    ratio: Number | None = None
    chance: Number | None = None
    beyond: bool = False
    systematic_nm: Number | None = None


class Adequacy(Result, frozen=True):
    """Whether the model is right."""

    shapes: tuple[ShapeScore, ...] = ()
    orders: tuple[OrderScore, ...] = ()
    lack_of_fit: tuple[LackOfFit, ...] = ()
    residual_autocorrelation: Number | None = None
    effective_samples: Number | None = None
    leave_one_level_out_nm: Number | None = None


class Sweeps(Result, frozen=True):
    """Repeats that were recorded as sweeps over all levels."""

    count: Count = 0
    shift_pct: dict[str, Number] = {}


class Uncertainty(Result, frozen=True):
    """Where the intervals come from."""

    ci: str = "none"
    nominal: Number = 0.95
    scatter_from: str = ""
    """repeats, curve, or within."""
    degrees_of_freedom: Number | None = None
    run_to_run_pct: dict[str, Number | None] = {}
    noise: Noise | None = None
    draws: Count | None = None
    sweeps: Sweeps | None = None
    share: ShareEstimate | None = None
    adequacy: Adequacy | None = None
