"""What to record next: levels, hold times and repeats that bring chosen intervals below a wanted width.

The width is predicted as the intervals themselves are found: V = (a + h)/R per level, the curve's variance
g'(Σ g g'/V)⁻¹g, Student's t with Satterthwaite's degrees of freedom: those of the runs that make the curve there. Of
all experiments on a grid of hold times, numbers of levels and repeats, the one that takes the least time on the rig is
taken.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Protocol, TypeAlias, TypeVar

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.estimate.draw import draw
from eaid.estimate.scatter import ASSUMED, TERMS, Noise, noise_of_fit
from eaid.estimate.spread import t_quantile
from eaid.models.nonlinear import terms
from eaid.models.parameters import SHARE, Friction
from eaid.results.fit import Fit, FrictionLevel
from eaid.synth.plants import Plant, clutch, of_fit

PARAMETERS = {"Ts": 0, "tau1": 1, "tau2": 2}
"""What a width can be wanted of: the curve over the duty, at its worst level."""
HOLDS = (1.5, 2.0, 3.0, 4.0)
"""Hold times tried, in units of each level's τ2: a record of about τ2 or less does not determine it."""
LEAST_HOLD_S = 5.0
LEAST_REPEATS, MOST_REPEATS = 3, 20


@dataclass(frozen=True)
class Session:
    """What the rig allows, and what each run costs beside its hold."""

    idle_s: float = 10.0
    release_s: float = 10.0
    most_levels: int = 12
    longest_hold_s: float = 120.0


@dataclass(frozen=True)
class Experiment:
    """Levels, holds and repeats, and what they are predicted to give."""

    levels: tuple[float, ...]
    hold_s: tuple[float, ...]
    repeats: int
    half_width_pct: dict[str, float]
    """At the worst level, of every parameter; infinite where it is not determined."""
    time_s: float
    """Time on the rig [s]."""
    met: bool
    """Whether every wanted width is reached."""


def within_runs(curves: Sequence[Friction], hold_s: Array, noise: Noise) -> Array:
    """Within-run variance h of (log T_s, log τ1, log τ2) of one run of each level, shape (L, 3)."""
    return np.array([noise.within(curve, float(hold)) for curve, hold in zip(curves, hold_s, strict=True)])


def half_widths(
    within: Array, curves: Sequence[Friction], levels: Array, repeats: Array, noise: Noise, polynomial: bool = True
) -> dict[str, Array]:
    """Predicted half-width of each parameter at the worst level [%], shape (R,); of the curve, or of single levels.

    `within` is what `within_runs` gives for the holds, shape (L, 3); `repeats`, shape (R,), are tried.
    """
    result = {}
    for name, k in PARAMETERS.items():
        variance = noise.scatter[k] ** 2 + within[:, k]
        degrees = np.full(len(levels), float(len(levels)))
        if polynomial:
            g = (
                terms(levels, TERMS[name], (levels[0], levels[-1]))
                / np.array([getattr(curve, name) for curve in curves])[:, None]
            )
            g = g / np.sqrt((g**2).sum(axis=0))
            spread = np.linalg.pinv((g / variance[:, None]).T @ g, rcond=1e-14, hermitian=True)
            parts = (g @ spread @ g.T) ** 2 / variance  # of the variance at a level, what each level contributes
            variance = parts.sum(axis=1)
            degrees = variance**2 / (parts**2).sum(axis=1)
        known = (repeats[:, None] - 1) * degrees
        if not polynomial and len(levels) > 3:
            known = np.maximum(1.0, known / 3.5)  # scatter that follows a trend over the levels costs at the ends
        reach = (t_quantile(known) * np.sqrt(variance / repeats[:, None])).max(axis=1)
        result[name] = 100 * np.expm1(np.minimum(reach, 50.0))
    return result


def quickest(
    curve_at: Callable[[float], Friction],
    candidates: Sequence[Sequence[float]],
    wanted: Mapping[str, float],
    noise: Noise,
    session: Session,
    polynomial: bool = True,
) -> Experiment:
    """The quickest experiment that reaches every wanted width; where none does, the one that comes nearest.

    `candidates` are the sets of levels to choose from.
    """
    best: tuple[float, Experiment] | None = None
    repeats = np.arange(LEAST_REPEATS, MOST_REPEATS + 1.0)
    for levels in candidates:
        curves = [curve_at(level) for level in levels]
        for factor in HOLDS:
            # whole seconds, within what the rig and the least record allow
            hold = np.ceil([min(max(factor * c.tau2, LEAST_HOLD_S), session.longest_hold_s) for c in curves])
            within = within_runs(curves, hold, noise)
            widths = half_widths(within, curves, np.array(levels), repeats, noise, polynomial and len(levels) > 1)
            time_s = repeats * (hold + session.idle_s + session.release_s).sum()
            over = np.max([widths[name] / width for name, width in wanted.items()], axis=0)
            # an experiment that falls short costs more than any that does not
            price = np.where(over <= 1, time_s, 1e9 * over + time_s)
            k = int(price.argmin())
            if best is None or price[k] < best[0]:
                width = {name: float(each[k]) for name, each in widths.items()}
                found = Experiment(
                    tuple(levels), tuple(hold.tolist()), int(repeats[k]), width, float(time_s[k]), bool(over[k] <= 1)
                )
                best = float(price[k]), found
    assert best is not None
    return best[1]


def level_sets(known: Sequence[float], most: int) -> list[list[float]]:
    """Equally spaced levels over the identified range, from eight (four more than T_s(u) has terms) to `most`.

    They are rounded to a sixteenth of their distance or less; of a single known level there is one set.
    """
    low, high = float(min(known)), float(max(known))
    if low == high:
        return [[low]]
    sets = []
    for count in range(min(8, most), most + 1):
        digits = int(np.floor(1.9 - np.log10((high - low) / (count - 1))))
        inner = [round(level, digits) for level in np.linspace(low, high, count).tolist()]
        sets.append(sorted({min(max(level, low), high) for level in inner}))
    return sets


POWER = 0.7
"""Power of the excess by which a plan is asked for narrower: widths fall faster than their prediction."""
LEAST, MOST = 1.03, 3.0
"""Least factor by which a width that was not kept is asked for narrower, and the excess that counts at most."""
ROUNDS = 6
"""Times that a plan is made larger."""

Widths = dict[str, float]
"""Half-width of the 95 % interval at the worst input [%], by parameter; infinite where there is none."""


class Planned(Protocol):
    """An experiment that was designed."""

    @property
    def met(self) -> bool:
        """Whether its predicted widths are those wanted."""

    @property
    def half_width_pct(self) -> Mapping[str, float]:
        """Its predicted widths."""


P = TypeVar("P", bound=Planned)


def enlarged(
    make: Callable[[Mapping[str, float]], P],
    measure: Callable[[P], list[Widths]],
    wanted: Mapping[str, float],
    keeping: float,
) -> tuple[P, list[Widths]]:
    """The plan that `make` gives for the wanted widths [%], larger until each is kept with probability `keeping`.

    A width measured too wide is asked for narrower in the next round. A plan that falls short even by its prediction is
    as large as the limits allow, and stays. Returned with it are its simulated widths, and those of the plans before it
    as far from its prediction as they were from their own.
    """
    widths = dict(wanted)
    plan = make(widths)
    rows = measure(plan)
    for _ in range(ROUNDS):
        excess = over(kept_widths(rows, keeping), wanted)
        if not plan.met or max(excess.values()) <= 1:
            break
        for name, ratio in excess.items():
            if ratio > 1:
                widths[name] /= max(LEAST, min(ratio, MOST) ** POWER)
        larger = make(widths)
        if larger != plan:
            known = {name: width for name, width in plan.half_width_pct.items() if 0 < width < inf}
            scale = {name: larger.half_width_pct[name] / width for name, width in known.items()}
            # a width without end says that the smaller plan was too small, and nothing of the larger one
            ended = [row for row in rows if max(row.values()) < inf]
            before = [{name: width * scale.get(name, 1.0) for name, width in row.items()} for row in ended]
            plan, rows = larger, before + measure(larger)
    return plan, rows


def kept_widths(rows: Sequence[Widths], keeping: float) -> Widths:
    """The width that the next recording keeps with probability `keeping`, each parameter by itself."""
    place = ceil(keeping * (len(rows) + 1) - 1e-9) - 1
    return {name: sorted(row[name] for row in rows)[place] for name in rows[0]}


def over(widths: Mapping[str, float], wanted: Mapping[str, float]) -> dict[str, float]:
    """Widths over the wanted ones, of what is wanted."""
    return {name: widths[name] / width for name, width in wanted.items()}


def finite(widths: Mapping[str, float]) -> dict[str, float | None]:
    """Widths as a result holds them: None where there is no interval."""
    return {name: width if width < float("inf") else None for name, width in widths.items()}


Rig: TypeAlias = tuple[Plant, Noise]


@dataclass(frozen=True)
class FittedRig:
    """A fit's plant, and the noise and scatter of its runs."""

    fit: Fit
    plant: Plant
    levels: Sequence[float]
    """The identified range of a clutch; the fitted levels of a friction experiment."""
    share: float
    """C."""
    noise: Noise
    known: bool
    """Whether the fit says how noisy the rig is; else the noise is assumed."""

    @property
    def degrees(self) -> float:
        """Degrees of freedom that the scatter is known by; 0: none are known."""
        return (self.fit.uncertainty.degrees_of_freedom if self.fit.uncertainty is not None else None) or 0.0

    @property
    def design_noise(self) -> Noise:
        """What to design with: the scatter that only one rig in five exceeds."""
        return self.noise.cautious(self.degrees if self.known else 0.0)

    def quickest(self, wanted: Mapping[str, float], session: Session) -> Experiment:
        """The quickest steps from rest for the wanted half-widths [%]."""
        polynomial = self.plant.kind == "clutch"
        candidates = level_sets(self.levels, session.most_levels) if polynomial else [list(self.levels)]
        return quickest(self.plant.at, candidates, wanted, self.design_noise, session, polynomial)

    def drawn(self, n: int, seed: int) -> list[Rig]:
        """`n` rigs that the data of the fit allow."""
        random = np.random.default_rng([seed, 3])
        if self.plant.kind == "clutch":
            plants = [clutch(model, self.plant.made_of) for model in draw(self.fit, n, seed).plants]
        else:
            assert self.fit.friction is not None
            plants = [_levels_drawn(self.plant, self.fit.friction.levels, random) for _ in range(n)]
        degrees = max(self.degrees, 1.0)
        chance = random.chisquare(degrees, (n, 3)) / degrees
        factors = 1 / np.sqrt(chance) if self.degrees > 0 else np.ones((n, 3))
        return [(plant, self.noise.scattered(row)) for plant, row in zip(plants, factors, strict=True)]


def rig_of(fit: Fit) -> FittedRig:
    """The rig that a fit describes; `DataError` where it holds neither a nonlinear nor a friction model."""
    if fit.nonlinear is None and (fit.data.kind == "clutch" or not fit.friction_levels):
        raise DataError("the fit holds neither a nonlinear nor a friction model to plan with; fit again")
    plant = of_fit(fit, "clutch" if fit.nonlinear is not None else fit.data.kind, "a fit")
    levels: Sequence[float] = plant.levels
    if plant.model is not None:
        levels, share = plant.model.u_range, plant.model.C
    else:
        share = (fit.friction.C if fit.friction is not None else None) or SHARE
    noise = noise_of_fit(fit)
    return FittedRig(fit, plant, levels, share, noise or ASSUMED, noise is not None)


def _levels_drawn(plant: Plant, rows: tuple[FrictionLevel, ...], random: np.random.Generator) -> Plant:
    """The same experiment with T_s, τ1, τ2 of each level drawn from their intervals, where they have some."""
    curves = {}
    for row in rows:
        drawn: dict[str, float] = {}
        for name in PARAMETERS:
            ends = None if row.ci95 is None else getattr(row.ci95, name)
            if ends is not None and ends[0] > 0:
                half_width = 0.5 * np.log(ends[1] / ends[0])
                factor = np.exp(random.standard_normal() * half_width / t_quantile(np.inf))
                drawn[name] = getattr(row, name) * float(factor)
        curves[row.level] = replace(row.curve, **drawn)
    return replace(plant, at=curves.__getitem__)
