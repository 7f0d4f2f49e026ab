"""What the residuals of a fit say about the rig's noise, in a form that another experiment can be planned with.

With A = ∫ J J' dt the within-run variances are the diagonal of A⁻¹ (∫ J J' (s0 + s1 f²) dt) A⁻¹: s0 [N²m²·s] from the
sensor, s1 [s] from ripple that goes with the torque f.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtri

from eaid.arrays import Array, inverse
from eaid.estimate.level_statistics import CURVES, LevelStatistics, log_jacobian
from eaid.models.parameters import Friction
from eaid.results import fit as results
from eaid.results.fit import Fit
from eaid.steps.stepset import RunRecord


@dataclass(frozen=True)
class Noise:
    """Noise within a run and scatter between runs."""

    sensor_nm2_s: float
    """s0: density of noise that does not go with the torque [N²m²·s]."""
    ripple_s: float
    """s1: density of noise that goes with the torque, as a share of it [s]."""
    scatter: tuple[float, float, float]
    """Run-to-run standard deviation of log T_s, log τ1, log τ2."""

    def within(self, curve: Friction, hold_s: float) -> Array:
        """Within-run variance of (log T_s, log τ1, log τ2) of a run that is held so long, shape (3,)."""
        return np.asarray(unit_variances(curve, hold_s) @ [self.sensor_nm2_s, self.ripple_s])


ASSUMED = Noise(sensor_nm2_s=1e-6, ripple_s=1e-5, scatter=(0.03, 0.05, 0.0))
"""Where a fit says nothing: 0.03 N·m of white noise at 1 kHz, ripple of 1 % with a memory of 0.05 s, 3 % and 5 %."""


def unit_variances(curve: Friction, hold_s: float) -> Array:
    """Variance of (log T_s, log τ1, log τ2) of a run under s0 = 1, and under s1 = 1, shape (3, 2)."""
    edges = np.concatenate([[0.0], np.geomspace(hold_s * 1e-5, hold_s, 400)])
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    jacobian = log_jacobian(curve, middle)
    weighed = jacobian.T * width
    unit = inverse(weighed @ jacobian)
    ripple = unit @ (weighed * jacobian[:, 0] ** 2) @ jacobian @ unit  # ∂f/∂log T_s is f itself
    return np.stack([np.diag(unit), np.diag(ripple)], axis=1)


def noise_of(stats: LevelStatistics, idle: float | None = None) -> results.Noise:
    """`uncertainty.noise` of a fit: the noise that the levels show.

    `idle` is the density of the sensor's noise while the rig idles, where it is known: only the ripple is then left to
    be found in the levels. Parameters that a level does not determine are left out.
    """
    known = np.flatnonzero(stats.determined[:, :3].all(axis=1)).tolist()
    records = [(stats.estimates[i].curve, stats.estimates[i].runs.duration_s) for i in known]
    units = np.reshape([unit_variances(*one) for one in records], (-1, 2))
    within = np.ravel([stats.estimates[i].runs.within[:3] for i in known])
    scatter = dict(zip(CURVES, _scatter(stats.between[:3]), strict=True))
    return results.Noise(*_densities(units, within, idle), scatter)


def _scatter(between: Array) -> tuple[float, float, float]:
    """Standard deviations of variances between runs, shape (3,); what is assumed where one cannot be seen."""
    pairs = zip(between.tolist(), ASSUMED.scatter, strict=True)
    Ts, tau1, tau2 = (float(np.sqrt(a)) if np.isfinite(a) else assumed for a, assumed in pairs)
    return Ts, tau1, tau2


def idle_of(runs: Sequence[RunRecord]) -> float | None:
    """Median density of the idle noise over the runs; None where none has idled long enough."""
    found = [run.idle_density for run in runs if run.idle_density is not None]
    return float(np.median(found)) if found else None


def _densities(units: Array, variance: Array, sensor: float | None) -> tuple[float, float]:
    """s0, s1 ≥ 0 of `variance` = `units` (s0, s1), relative errors alike; s0 may be known."""
    if not len(variance):
        return ASSUMED.sensor_nm2_s if sensor is None else sensor, ASSUMED.ripple_s
    design = units / np.maximum(variance, 1e-300)[:, None]
    if sensor is not None:
        return sensor, max(0.0, float(design[:, 1] @ (1 - sensor * design[:, 0]) / (design[:, 1] @ design[:, 1])))
    scale = np.sqrt((design**2).sum(axis=0))
    found = nnls(design / scale, np.ones(len(design)))[0] / scale
    return float(found[0]), float(found[1])


def noise_of_fit(fit: Fit) -> Noise | None:
    """The noise that a fit holds; None: it says none."""
    held = fit.uncertainty.noise if fit.uncertainty is not None else None
    if held is None or not {"Ts", "tau1", "tau2"} <= set(held.scatter):
        return None
    return Noise(held.sensor_nm2_s, held.ripple_s, (held.scatter["Ts"], held.scatter["tau1"], held.scatter["tau2"]))


def cautious(noise: Noise, degrees: float) -> Noise:
    """The same with the scatter that only one rig in five exceeds, known by so many `degrees` of freedom."""
    factor = float(np.sqrt(degrees / chdtri(degrees, 0.8))) if degrees > 0 else 1.0
    return scattered(noise, np.full(3, factor))


def scattered(noise: Noise, factors: Array) -> Noise:
    """The same with other scatter of (T_s, τ1, τ2), by factors of shape (3,)."""
    Ts, tau1, tau2 = (np.array(noise.scatter) * factors).tolist()
    return replace(noise, scatter=(Ts, tau1, tau2))
