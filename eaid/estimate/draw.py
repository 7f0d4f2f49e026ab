"""Plants drawn from a fit's uncertainty: other models that the same data would allow.

A deviation δc of the coefficients is drawn with the covariance kept in the fit. Over the range it moves each curve's
logarithm by d = g'δc. The scatter behind that covariance is known from a few runs only, so d is stretched by
√(ν/χ²(ν)), which makes it Student's t with the ν degrees of freedom of the parameter. A polynomial is then put through
p(u) e^d by least squares of the relative error.

Of other kinds of plant a fit keeps intervals of its numbers: each is drawn by its own, on its logarithm, as if it were
independent of the others, which makes the ranges rather wide.

The constraints of the fit (τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0 over the identified duties) are linear in the coefficients: a
draw that breaks one is drawn again and counted, and after many refusals pulled back along the line to the fit.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from eaid.arrays import Array, median
from eaid.errors import DataError
from eaid.estimate.coefficients import CURVES_ORDER, coefficient_limits, coefficients_of
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.plant.dynamics import Plant
from eaid.plant.forms import terms
from eaid.results.fit import Fit
from eaid.results.plant import FittedPlant

MOST_REFUSED = 200
DRAWN_INPUTS = 11  # Inputs over the identified range at which a curve is drawn
FARTHEST_DRAW = 4.0  # Logarithm beyond which no draw goes: a factor of 55
MANY_REJECTED = 0.05  # Share of rejected draws from which the reader has to know of it


@dataclass(frozen=True, eq=False)
class Drawn:
    """Plants, and how many draws were rejected on the way because they broke a constraint."""

    plants: tuple[Plant, ...]
    rejected: int

    @property
    def rejected_share(self) -> float:
        """Rejected draws, as a share of all."""
        return self.rejected / max(self.rejected + len(self.plants), 1)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Told where constraints have cut a good part of the draws away: the ranges are then narrower than the data."""
        if self.rejected_share <= MANY_REJECTED:
            return ()
        return (finding("draws-rejected", "plants", (), pct=100 * self.rejected_share, plants=len(self.plants)),)


def drawable(fit: Fit) -> bool:
    """Whether a fit holds what plants are drawn with, a covariance or intervals; without it all of them are the fitted
    plant."""
    model = fit.nonlinear
    if fit.plant_ is not None and fit.plant_.kind != "parallel":
        return any(_log_error(fit.plant_, name) > 0 for name in fit.plant_.numbers)
    return model is not None and model.covariance is not None and bool(model.covariance.matrix)


def draw(fit: Fit, n: int, seed: int) -> Drawn:
    """`n` plants that the data of a fit allow; all are the fitted one where it holds nothing for it (`drawable`).

    `DataError` without a nonlinear model, or for a covariance of another shape than its coefficients.
    """
    centre = fit.plant
    if not drawable(fit):
        return Drawn((centre,) * n, 0)
    if fit.plant_ is not None and fit.plant_.kind != "parallel":
        return Drawn(_by_intervals(fit.plant_, n, np.random.default_rng(seed)), 0)
    assert fit.nonlinear is not None and fit.nonlinear.covariance is not None
    stored = fit.nonlinear.covariance
    free = (stored.order or ("",))[-1] == "C"
    at_centre = coefficients_of(centre, free)
    mean, count = at_centre.values, len(at_centre.values)
    matrix = np.array(stored.matrix, dtype=np.float64)
    if matrix.shape != (count, count) or not np.isfinite(matrix).all():
        raise DataError(
            f"nonlinear.covariance.matrix: shape {matrix.shape}, expected {count} x {count} finite numbers; fit again"
        )
    parts = [(at_centre.block(name), name) for name in CURVES_ORDER]
    blocks = [_Block(own, mean[own], stored.degrees_of_freedom.get(name), centre.u_range) for own, name in parts]
    # a root of the covariance, in scaled form: its condition is that of the correlations
    sd = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    unit = np.where(sd > 0, sd, 1.0)
    size, vectors = np.linalg.eigh(matrix / np.outer(unit, unit))
    # a sign of its own for each vector, so that the same file gives the same plants on every machine
    vectors = vectors * np.where(vectors[np.abs(vectors).argmax(axis=0), np.arange(count)] < 0, -1.0, 1.0)
    root = unit[:, None] * vectors * np.sqrt(np.maximum(size, 0.0))
    slack, offset = coefficient_limits(at_centre)
    at_fit = slack @ mean - offset
    allowed = np.minimum(at_fit, 0.0) - 1e-12  # every constraint, as far as the fit itself keeps it
    random = np.random.default_rng(seed)
    plants, rejected = [], 0
    for _ in range(n):
        step, refused = _feasible(root, blocks, slack, at_fit, allowed, random)
        rejected += refused
        p = replace(at_centre, values=mean + step).plant()
        C = min(max(float(mean[-1] + step[-1]), 0.0), 1.0) if free else centre.C
        plants.append(centre.moved(p.tau1, p.tau2, p.Ts, C))
    return Drawn(tuple(plants), rejected)


def _log_error(part: FittedPlant, name: str) -> float:
    """Standard error of the logarithm of a plant's number, by its interval, or the middle of those at its inputs; 0
    where there is none."""
    if part.ci95 is None:
        return 0.0
    rows = part.ci95.levels.get("Ts" if name == "gain" else name, ())
    alone = getattr(part.ci95, name)
    ends = [alone] if alone is not None else [(low, high) for _, low, high in rows]
    return median([np.log(high / low) for low, high in ends if 0 < low < high] or [0.0]) / (
        2 * float(t_quantile(np.inf))
    )


def _by_intervals(part: FittedPlant, n: int, random: "np.random.Generator") -> tuple[Plant, ...]:
    """Plants of another kind than the clutch's, each number drawn by its own interval."""
    errors = {name: _log_error(part, name) for name in part.numbers}
    each = ({name: float(np.exp(sd * random.standard_normal())) for name, sd in errors.items()} for _ in range(n))
    return tuple(part.plant.times(by) for by in each)


class _Block:
    """How deviations of one parameter's coefficients get the tails of Student's t, and keep its curve above 0."""

    def __init__(self, own: slice, values: Array, degrees: float | None, u_range: tuple[float, float]) -> None:
        self.own, self.values, self.degrees = own, values, degrees or np.inf
        design = terms(np.linspace(*u_range, DRAWN_INPUTS), len(values), u_range)
        curve = design @ values
        self.usable = bool((curve > 0).all())
        self.slopes = design / np.where(curve > 0, curve, 1.0)[:, None]
        self.back = np.linalg.pinv(self.slopes)

    def with_tails(self, step: Array, at: float) -> Array:
        """The deviation `step`, shape (p,), with tails; `at`: where in its distribution the scatter lies, 0 to 1."""
        if not self.usable:
            return step
        factor = np.sqrt(self.degrees / chdtri(self.degrees, at)) if np.isfinite(self.degrees) else 1.0
        moved = np.clip(self.slopes @ step * factor, -FARTHEST_DRAW, FARTHEST_DRAW)
        return np.asarray(self.back @ np.exp(moved) - self.values)


def _feasible(
    root: Array, blocks: list[_Block], slack: Array, at_fit: Array, allowed: Array, random: "np.random.Generator"
) -> tuple[Array, int]:
    """One deviation whose slack, `at_fit` at the fit, is nowhere below what is allowed; and how many were refused."""
    step = np.zeros(len(root))
    for refused in range(MOST_REFUSED):
        step = root @ random.standard_normal(len(root))
        for block, at in zip(blocks, random.random(len(blocks)), strict=True):
            step[block.own] = block.with_tails(step[block.own], at)
        if (at_fit + slack @ step >= allowed).all():
            return step, refused
    change = slack @ step
    falling = change < 0
    reach = float(np.min((allowed[falling] - at_fit[falling]) / change[falling]))
    return np.asarray(0.999 * max(0.0, min(1.0, reach)) * step), MOST_REFUSED
