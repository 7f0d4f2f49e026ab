"""What the residuals of a fit say about the rig's noise, in a form that another experiment can be planned with.

A parameter's within-run variance is h = S [(∫ J J' dt)⁻¹]_kk with a noise density S, taken as S = s0 + s1 T_s²: s0 from
the sensor [N²m²·s], s1 from ripple that goes with the torque [s].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from eaid.arrays import Array
from eaid.models.parameters import Friction
from eaid.results import fit as results
from eaid.steps.stepset import RunRecord
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import log_jacobian


@dataclass(frozen=True)
class Noise:
    """Noise within a run and scatter between runs."""

    sensor_nm2_s: float
    """s0: density of noise that does not go with the torque [N²m²·s]."""
    ripple_s: float
    """s1: density of noise that goes with the torque, as a share of it [s]."""
    scatter: tuple[float, float, float]
    """Run-to-run standard deviation of log T_s, log τ1, log τ2."""

    def density(self, steady_nm: float) -> float:
        """S at a steady torque [N²m²·s]."""
        return self.sensor_nm2_s + self.ripple_s * steady_nm**2


ASSUMED = Noise(sensor_nm2_s=1e-6, ripple_s=1e-5, scatter=(0.03, 0.05, 0.0))
"""Where a fit says nothing: 0.03 N·m of white noise at 1 kHz, ripple of 1 % with a memory of 0.05 s, 3 % and 5 %."""


def inverse_information(curve: Friction, hold_s: float) -> Array:
    """(∫ J J' dt)⁻¹ over a hold, J = ∂f/∂(log T_s, log τ1, log τ2), shape (3, 3) [1/(N²m²·s)]."""
    edges = np.concatenate([[0.0], np.geomspace(hold_s * 1e-5, hold_s, 400)])
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    jacobian = log_jacobian(curve, middle)
    return np.asarray(np.linalg.pinv((jacobian.T * width) @ jacobian, rcond=1e-14, hermitian=True))


def noise_of(stats: LevelStatistics, idle: float | None = None) -> Noise:
    """The noise that the levels show; parameters that a level does not determine are left out.

    `idle` is the density of the sensor's noise while the rig idles, where it is known: only the ripple is then left to
    be found in the levels.
    """
    density, square = [], []
    for one, known in zip(stats.estimates, stats.determined, strict=True):
        if not known[:3].all():
            continue
        per_second = np.diag(inverse_information(one.curve, one.runs.duration_s))
        ratio = one.runs.within[:3] / np.maximum(per_second, 1e-300)
        density.append(float(np.exp(np.mean(np.log(np.maximum(ratio, 1e-300))))))
        square.append(one.curve.Ts**2)
    sensor, ripple = _line(np.array(square), np.array(density), idle)
    pairs = zip(stats.between, ASSUMED.scatter, strict=False)
    sizes = [float(np.sqrt(a)) if np.isfinite(a) else assumed for a, assumed in pairs]
    return Noise(sensor, ripple, (sizes[0], sizes[1], sizes[2]))


def idle_of(runs: Sequence[RunRecord]) -> float | None:
    """Median density of the idle noise over the runs; None where none has idled long enough."""
    found = [run.idle_density for run in runs if run.idle_density is not None]
    return float(np.median(found)) if found else None


def _line(x: Array, y: Array, s0: float | None) -> tuple[float, float]:
    """s0, s1 ≥ 0 of y = s0 + s1 x, relative errors alike; s0 may be known."""
    if not len(x):
        return ASSUMED.sensor_nm2_s if s0 is None else s0, ASSUMED.ripple_s
    if s0 is not None:
        y = np.maximum(y, 1e-300)
        return s0, max(0.0, float((x / y) @ (1 - s0 / y) / max(float((x / y) @ (x / y)), 1e-300)))
    if len(x) == 1 or np.ptp(x) == 0:
        return float(y.mean()), 0.0
    design = np.stack([1 / np.maximum(y, 1e-300), x / np.maximum(y, 1e-300)], axis=1)
    scale = np.sqrt((design**2).sum(axis=0))
    s = np.linalg.lstsq(design / scale, np.ones(len(y)), rcond=None)[0] / scale
    if (s >= 0).all():
        return float(s[0]), float(s[1])
    alone = [float(design[:, k].sum() / (design[:, k] ** 2).sum()) for k in (0, 1)]
    left = [float(((1 - design[:, k] * alone[k]) ** 2).sum()) for k in (0, 1)]
    return (alone[0], 0.0) if left[0] <= left[1] else (0.0, alone[1])


def noise_part(noise: Noise) -> results.Noise:
    """For `uncertainty.noise` of a fit."""
    return results.Noise(
        noise.sensor_nm2_s, noise.ripple_s, dict(zip(("Ts", "tau1", "tau2"), noise.scatter, strict=True))
    )


def noise_of_fit(fit: results.Fit) -> Noise | None:
    """The noise that a fit holds; None where it does not say."""
    stored = fit.uncertainty.noise if fit.uncertainty is not None else None
    if stored is None or not {"Ts", "tau1", "tau2"} <= set(stored.scatter):
        return None
    scatter = stored.scatter
    return Noise(stored.sensor_nm2_s, stored.ripple_s, (scatter["Ts"], scatter["tau1"], scatter["tau2"]))


def cautious(noise: Noise, degrees: float) -> Noise:
    """The same with the scatter that only one rig in five exceeds, known by so many `degrees` of freedom."""
    factor = float(np.sqrt(degrees / chdtri(degrees, 0.8))) if degrees > 0 else 1.0
    Ts, tau1, tau2 = noise.scatter
    return Noise(noise.sensor_nm2_s, noise.ripple_s, (factor * Ts, factor * tau1, factor * tau2))
