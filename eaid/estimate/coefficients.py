"""The coefficients of τ1(u), τ2(u), T_s(u), and C where it is free, in powers of u/100, with their covariance.

All are then of the order of one, and a covariance of them can be inverted; results hold powers of the input itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array, median
from eaid.estimate.forms import Model, nonlinear
from eaid.estimate.spread import t_quantile
from eaid.plant.dynamics import CHECKED_INPUTS, Plant
from eaid.plant.forms import scales
from eaid.results import models as results
from eaid.results.common import Interval
from eaid.results.models import CoefficientIntervals, Covariance, CurveLevel

CURVES_ORDER = ("tau1", "tau2", "Ts")  # Order of the coefficients in every covariance; C last where it was free


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of (u/100)^k in the order of `CURVES_ORDER`, C last where free."""

    values: Array
    counts: tuple[int, int, int]
    u_range: tuple[float, float]
    share: float
    share_free: bool

    def block(self, name: str) -> slice:
        """Where the coefficients of τ1, τ2 or T_s stand."""
        k = CURVES_ORDER.index(name)
        return slice(sum(self.counts[:k]), sum(self.counts[: k + 1]))

    def plant(self) -> Plant:
        """The model in powers of the input itself."""
        parts = [self.values[self.block(name)] / scales(n) for name, n in zip(CURVES_ORDER, self.counts, strict=True)]
        tau1, tau2, Ts = (tuple(part.tolist()) for part in parts)
        return Plant(tau1, tau2, Ts, self.u_range, self.share)


def coefficients_of(p: Plant, share_free: bool = False) -> Coefficients:
    """The coefficients of a model."""
    parts = (p.tau1, p.tau2, p.Ts)
    values = np.concatenate([np.array(part) * scales(len(part)) for part in parts])
    values = np.append(values, p.C) if share_free else values
    return Coefficients(values, (len(p.tau1), len(p.tau2), len(p.Ts)), p.u_range, p.C, share_free)


def map_unknowns(model: Model) -> Array:
    """How the coefficients follow from the unknowns of a model, (P, n)."""
    rows = [coefficients_of(model.parameters(row), model.free_share).values for row in np.eye(model.size)]
    return np.array(rows).T


def coefficient_limits(c: Coefficients) -> tuple[Array, Array]:
    """A and b of A c ≥ b: the constraints of a fit but for how long its records are."""
    model = nonlinear(np.linspace(*c.u_range, CHECKED_INPUTS), None if c.share_free else c.share)
    limits = model.limits(np.inf)
    return limits.A @ np.linalg.pinv(map_unknowns(model)), limits.b


def with_intervals(
    part: results.Nonlinear,
    curves: Sequence[CurveLevel],
    covariance: Array,
    degrees: Mapping[str, float | Array],
    constrained: tuple[str, ...] = (),
) -> results.Nonlinear:
    """A model with its curves, the covariance that plants are drawn with, and intervals of its powers (None: held)."""
    c, sd = coefficients_of(part.parameters, part.C_free), np.sqrt(np.maximum(np.diag(covariance), 0))
    intervals: dict[str, tuple[Interval, ...]] = {}
    order: list[str] = []
    for name, count in zip(CURVES_ORDER, c.counts, strict=True):
        order += [f"{name}[{i}]" for i in range(count)]
        block = c.block(name)
        scale = scales(count)
        reach = t_quantile(median(degrees[name])) * sd[block]
        low, high = (c.values[block] - reach) / scale, (c.values[block] + reach) / scale
        held = name in constrained or not np.isfinite(reach).all()
        carried = (c.values[block] != 0) | (reach > 0)  # a power that the levels do not carry is 0, not known to be 0
        intervals[name] = tuple(
            (float(a), float(b)) if fine and not held else None for a, b, fine in zip(low, high, carried, strict=True)
        )
    share: Interval = None
    if c.share_free:
        order.append("C")
        reach = t_quantile(min(median(df) for df in degrees.values())) * sd[-1]
        if np.isfinite(reach):
            share = (max(0.0, float(c.values[-1] - reach)), min(1.0, float(c.values[-1] + reach)))
    kept: dict[str, float | None] = {name: median(df) for name, df in degrees.items()}
    return msgspec.structs.replace(
        part,
        curves=tuple(curves),
        ci95=CoefficientIntervals(**intervals, C=share),
        covariance=Covariance(tuple(order), tuple(tuple(row) for row in covariance.tolist()), kept),
    )
