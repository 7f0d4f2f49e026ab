"""What recordings tell of a model; and of steps of another kind of plant than the clutch's two lags over the input.

With J from the sensitivities of the model, its rows gathered by engagement e (a stretch under load between two rests),
an experiment knows its unknowns by

    H_e = ∫ J J' dt,   Ω_e = ∫ J J' S(T) dt,   H = Σ H_e,   S(T) = s0 + s1 T² the density of the noise

A number with the gradient g then varies by the noise, Σ_e g'H⁻¹ Ω_e H⁻¹g, and by the scatter between engagements,
Σ_e (g'H⁻¹ H_e d)², d its standard deviation in the unknowns: an engagement that sees few levels bends the curves.

One lag has T_s and τ1; two that overshoot, and two in series, T_s, τ1 and τ2; ringing T_s, ω and ζ. In series
ln τ1,2 = ln(1/ω) + ln(ζ ∓ √(ζ² − 1)). A C above 1, z and a dead time are unknowns beside them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.estimate.forms import Model, of_kind
from eaid.estimate.recorded_log import RecordedLog
from eaid.plant.drive import Drive
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond
from eaid.recorded.engagements import engagement_starts
from eaid.recorded.from_logs import Setup, fit_near, setup_of
from eaid.recorded.log_intervals import spread
from eaid.results.models import Noise
from eaid.results.plan import PlannedRun

# What a width can be wanted of: the curve over the duty, at its worst level; and that of kinds with other numbers
PARAMETERS: tuple[str, ...] = ("Ts", "tau1", "tau2")
NUMBERS_OF_KIND = {"lag": ("Ts", "tau1"), "ringing": ("Ts", "omega", "zeta")}
PER_LAG, FEWEST_SAMPLES = 10, 20  # Samples of a simulated log in its fastest time constant, and in a hold at least


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """A model, and how the logarithms of its numbers go with its unknowns."""

    model: Model
    unknowns: Array  # (n,); those of `extras` last
    slopes: Array  # At the inputs at which widths are wanted, by the first so many of them, (numbers, m, n)
    extras: tuple[str, ...] = ()  # What is among the unknowns besides the coefficients: a dead time, falls of their own
    falls_as_left: bool = False  # Whether falls to rest go as at the input that was left

    def variances(self, noise: Noise, drive: Drive, weight: Array | float = 1.0) -> tuple[Array, Array]:
        """Variance of these logarithms by noise and scatter of each engagement, (3, m, E); `weight` of rows."""
        x = np.append(self.unknowns, 0.0)[: len(self.unknowns) + (not drive.idle_known)]
        slopes = np.pad(self.slopes, ((0, 0), (0, 0), (0, len(x) - self.slopes.shape[2])))
        scattered = np.zeros((len(x), 3))  # one standard deviation of an engagement's T_s, τ1 and τ2
        for k, (name, part) in enumerate(zip(PARAMETERS, self.model.slices, strict=True)):
            scattered[part, k] = noise.scatter[name] * x[part]
        setup = Setup(self.model, (drive,), self.extras, falls_as_left=self.falls_as_left)
        J, r = setup.jacobian(x, 0)
        counted = drive.w > 0
        T2 = r * r / np.maximum(drive.w[counted], 1e-300)
        density = (noise.sensor_nm2_s + noise.ripple_s * T2) * weight
        J = J * np.sqrt(np.broadcast_to(weight, len(J)))[:, None]
        starts = engagement_starts(drive)[1:]
        H = np.array([part.T @ part for part in np.split(J, starts)])
        omega = np.array([part.T @ part for part in np.split(J * np.sqrt(density)[:, None], starts)])
        size = np.sqrt(np.maximum(np.diagonal(H.sum(axis=0)), 1e-300))
        try:
            back = np.linalg.inv(H.sum(axis=0) / np.outer(size, size)) / np.outer(size, size)
        except np.linalg.LinAlgError:
            return np.full((*slopes.shape[:2], len(H)), np.inf), np.zeros((*slopes.shape[:2], len(H)))
        g = slopes @ back
        within = np.einsum("kmi,eij,kmj->kme", g, omega, g, optimize=True)
        return np.maximum(within, 0.0), (np.einsum("kmi,eij->kmej", g, H @ scattered) ** 2).sum(axis=3)


def is_clutch(p: Plant) -> bool:
    """Whether a plant is the clutch's: two lags in parallel, C held; a dead time is then taken as known."""
    return p.kind == "parallel"


def steps_of(p: Plant, levels: Array) -> Sensitivities:
    """The model of a plant that is not the clutch's."""
    gain, zero = p.gain, None if p.zero else 0.0
    model = of_kind("lag" if p.kind == "lag" else "swing", gain, *p.u_range, shortest_s=1.0, zero=zero)
    steady = np.maximum(p.steady(levels), 1e-300)
    lags: list[float] = [p.tau1[0]]
    by_lags = np.array([[1 / p.tau1[0]]])
    if p.zeta is not None:
        root = np.sqrt(max(p.zeta**2 - 1, 1e-12))
        by_zeta = (-1 / root, 1 / root) if p.kind == "series" else (0.0, 1 / p.zeta)
        lags += [p.zeta, *([p.zero] if p.zero else [])]
        by_lags = np.array([[1 / p.tau1[0], by_zeta[0]], [1 / p.tau1[0] * (p.kind == "series"), by_zeta[1]]])
    elif p.kind != "lag":
        model = replace(model, tau2=model.tau1, share=None, kind="parallel")
        lags += [p.tau2[0], p.C]
        by_lags = np.diag([1 / p.tau1[0], 1 / p.tau2[0]])
    lags += [p.dead_time_s] * (p.dead_time_s > 0)
    unknowns = np.append(np.linalg.solve(gain.rows(gain.inputs), p.steady(gain.inputs)), lags)
    slopes = np.zeros((1 + len(by_lags), len(levels), len(unknowns)))
    slopes[0, :, : gain.size] = gain.rows(levels) / steady[:, None]
    slopes[1:, :, gain.size : gain.size + by_lags.shape[1]] = by_lags[:, None]
    return Sensitivities(model, unknowns, slopes, ("dead",) * (p.dead_time_s > 0))


def falls_of(p: Plant) -> dict[str, tuple[float, ...]]:
    """What a clutch's falls have of their own, as a fit of its logs has it among the unknowns."""
    own: dict[str, tuple[float, ...]] = {}
    if p.release is not None and not p.release_as_left:
        own["rest"] = p.release
    if p.falls != (1.0, 1.0):
        own["fall"] = p.falls
    if p.excess:
        own["excess"] = (p.excess,)
    return own


def refuse_unplanned(p: Plant) -> None:
    """Refuse a plant whose steps no information is computed of."""
    varying = not is_clutch(p) and any((*p.tau1[1:], *(p.tau2[1:] if p.kind == "overshoot" else ())))
    if p.signed:
        raise DataError(
            f"the fit's plant ({p.kind}) has an input of both signs, and sessions are planned of steps to one side of "
            "rest; hold each input for five of the longest time constant, and repeat it"
        )
    if varying:
        raise DataError(f"the fit's plant ({p.kind}) has time constants over the input, which no plan is made for")


def input_changes(runs: Sequence[PlannedRun]) -> list[tuple[float, float]]:
    """The whole session as (from when [s], input), held until the next; the last entry ends it."""
    changes, now = [(0.0, 0.0)], 0.0
    for run in runs:
        step_s, end_s = now + run.idle_s, now + run.idle_s + run.hold_s
        changes += [(step_s, run.level), (end_s, 0.0)]
        now = end_s + run.release_s
    return [*changes, (now, 0.0)]


def session_widths(p: Plant, noise: Noise, runs: Sequence[PlannedRun], k: int, seed: int) -> Array:
    """Half-widths of the logarithms at the worst level, as the `k`-th recorded session tells them, (numbers,)."""
    random = np.random.default_rng([seed, k])
    at, inputs = np.array(input_changes(runs)).T
    levels = np.unique(inputs[inputs > 0])
    fastest = float(np.min(p.time_constants(levels)[0]))
    step_s = min(fastest / PER_LAG, min(run.hold_s for run in runs) / FEWEST_SAMPLES)
    at = step_s * np.round(at / step_s)  # a change between two rows would be noted late
    time_s = np.arange(round(at[-1] / step_s)) * step_s
    place = np.searchsorted(at, time_s + 0.5 * step_s, side="right") - 1
    gains = 1 + noise.scatter["Ts"] * random.standard_normal(len(runs) + 1)
    output = respond(p, at, inputs, time_s) * gains[np.cumsum(inputs > 0)[place]]
    white, share = random.standard_normal((2, len(time_s)))
    output += np.sqrt(noise.sensor_nm2_s / step_s) * white + np.sqrt(noise.ripple_s / step_s) * share * output
    steps = steps_of(p, levels)
    x = steps.unknowns[: steps.model.size]
    setup = setup_of(steps.model, [RecordedLog("planned", time_s, inputs[place], output)], True, p.dead_time_s)
    setup = replace(setup, drives=setup.every.drives, copies=())
    if steps.extras:
        x, setup = steps.unknowns, replace(setup, extras=steps.extras)
    solved = fit_near(setup, np.append(x, np.zeros(setup.size - len(x))))
    slopes = np.pad(steps.slopes, ((0, 0), (0, 0), (0, setup.size - steps.slopes.shape[2])))
    return np.asarray(np.apply_along_axis(spread(solved).of, 2, slopes).max(axis=1))
