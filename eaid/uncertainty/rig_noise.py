"""What the residuals of a fit say about the rig's noise, in a form that another experiment can be planned with.

With A = ∫ J J' dt the within-run variances are the diagonal of A⁻¹ (∫ J J' (s0 + s1 f²) dt) A⁻¹: s0 [N²m²·s] from the
sensor, s1 [s] from ripple that goes with the torque f. Ripple that is periodic may be counted apart (`periodic`), for
its weight falls faster with the hold.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtri

from eaid.arrays import Array, inverse
from eaid.models.parameters import Friction
from eaid.results import uncertainty as results
from eaid.results.fit import Fit
from eaid.steps.stepset import RunRecord
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import CURVES, log_jacobian
from eaid.uncertainty.periodic import Periodic, periodic_part


@dataclass(frozen=True)
class Noise:
    """Noise within a run and scatter between runs."""

    sensor_nm2_s: float
    """s0: density of noise that does not go with the torque [N²m²·s]."""
    ripple_s: float
    """s1: density of noise that goes with the torque, as a share of it [s]."""
    scatter: tuple[float, float, float]
    """Run-to-run standard deviation of log T_s, log τ1, log τ2."""
    periodic: Periodic | None = None
    """Ripple that is periodic and that `ripple_s` and `scatter` do not count; None: they count all."""

    def within(self, curve: Friction, hold_s: float) -> Array:
        """Within-run variance of (log T_s, log τ1, log τ2) of a run that is held so long, shape (3,)."""
        white = unit_variances(curve, hold_s) @ [self.sensor_nm2_s, self.ripple_s]
        return np.asarray(white if self.periodic is None else white + self.periodic.variance(curve, hold_s))


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
    """`uncertainty.noise` of a fit: the noise that the levels show, and what is left of it beside a periodic ripple.

    `idle` is the density of the sensor's noise while the rig idles, where it is known: only the ripple is then left to
    be found in the levels. Parameters that a level does not determine are left out.
    """
    known = np.flatnonzero(stats.determined[:, :3].all(axis=1)).tolist()
    records = [(stats.estimates[i].curve, stats.estimates[i].runs.duration_s) for i in known]
    units = np.reshape([unit_variances(*one) for one in records], (-1, 2))
    within = np.ravel([stats.estimates[i].runs.within[:3] for i in known])
    whole = Noise(*_densities(units, within, idle), _scatter(stats.between[:3]))
    found = periodic_part([stats.levels[i] for i in known], [stats.estimates[i] for i in known]) if known else None
    if found is None:
        return _part(whole)
    wave, density, square = found
    left = Noise(*_densities(np.stack([np.ones(len(square)), square], axis=1), density, idle), whole.scatter, wave)
    counted = np.array([left.within(*one) for one in records])
    total = (stats.expected[:, :3] * stats.repeats[:, None])[known]
    between = np.fmin(stats.between[:3], np.maximum(np.median(total - counted, axis=0), 0.0))
    beside = _part(replace(left, scatter=_scatter(np.where(np.isfinite(stats.between[:3]), between, np.nan))))
    return msgspec.structs.replace(
        _part(whole), periodic=results.PeriodicRipple(wave.period_s, 100 * wave.amplitude, beside)
    )


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


def _part(noise: Noise) -> results.Noise:
    return results.Noise(noise.sensor_nm2_s, noise.ripple_s, dict(zip(CURVES, noise.scatter, strict=True)))


def noise_of_fit(fit: Fit, apart: bool = False) -> Noise | None:
    """The noise that a fit holds, periodic ripple counted in or, where it is asked for, `apart`; None: it says none."""
    stored = fit.uncertainty.noise if fit.uncertainty is not None else None
    wave = stored.periodic if stored is not None and apart else None
    held = stored if wave is None else wave.beside
    if held is None or not {"Ts", "tau1", "tau2"} <= set(held.scatter):
        return None
    scatter = (held.scatter["Ts"], held.scatter["tau1"], held.scatter["tau2"])
    periodic = None if wave is None else Periodic(wave.period_s, wave.amplitude_pct / 100)
    return Noise(held.sensor_nm2_s, held.ripple_s, scatter, periodic)


def cautious(noise: Noise, degrees: float) -> Noise:
    """The same with the scatter that only one rig in five exceeds, known by so many `degrees` of freedom."""
    factor = float(np.sqrt(degrees / chdtri(degrees, 0.8))) if degrees > 0 else 1.0
    return scattered(noise, np.full(3, factor))


def scattered(noise: Noise, factors: Array) -> Noise:
    """The same with other scatter of (T_s, τ1, τ2), by factors of shape (3,)."""
    Ts, tau1, tau2 = (np.array(noise.scatter) * factors).tolist()
    return replace(noise, scatter=(Ts, tau1, tau2))
