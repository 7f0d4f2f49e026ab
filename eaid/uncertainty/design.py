"""What to record next: levels, hold times and repeats that bring chosen intervals below a wanted width.

The width is predicted as the intervals themselves are found: V = (a + h)/R per level, the curve's variance
g'(Σ g g'/V)⁻¹g, Student's t with L(R − 1) degrees of freedom. Of all experiments on a grid of hold times, numbers of
levels and repeats, the one that takes the least time on the rig is taken.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.models.parameters import Friction
from eaid.uncertainty.curve import powers
from eaid.uncertainty.level_statistics import TERMS
from eaid.uncertainty.noise import Noise, inverse_information
from eaid.uncertainty.student_t import t_quantile

PARAMETERS = {"Ts": 0, "tau1": 1, "tau2": 2}
"""What a width can be wanted of: the curve over the duty, at its worst level."""
HOLDS = (1.5, 2.0, 3.0, 4.0)
"""Hold times tried, in units of each level's τ2: a record of about τ2 or less does not determine it."""
LEAST_HOLD_S = 5.0
LEAST_REPEATS, MOST_REPEATS = 3, 20


@dataclass(frozen=True)
class Wanted:
    """A half-width of a 95 % interval [%] that is not to be exceeded at any level."""

    parameter: str
    half_width_pct: float


@dataclass(frozen=True)
class Rig:
    """What each run costs beside its hold."""

    idle_s: float = 10.0
    release_s: float = 10.0
    most_levels: int = 12
    longest_hold_s: float = 120.0


@dataclass(frozen=True)
class Plan:
    """One experiment and what it is predicted to give."""

    levels: tuple[float, ...]
    hold_s: tuple[float, ...]
    repeats: int
    half_width_pct: dict[str, float]
    """At the worst level, of every parameter."""
    time_s: float
    """Time on the rig [s]."""
    met: bool
    """Whether every wanted width is reached."""


def wanted_of(text: str) -> list[Wanted]:
    """`tau2=10,Ts=2` as widths in percent; raises UsageError."""
    found = []
    for part in text.split(","):
        name, _, number = part.partition("=")
        name = name.strip()
        try:
            width = float(number.strip().removesuffix("%"))
        except ValueError:
            width = 0.0
        if name not in PARAMETERS or not 0 < width < 100:
            raise UsageError(
                f"--want {text}: write {'='.join(['tau2', '10'])},Ts=2: a parameter of {', '.join(PARAMETERS)} and a "
                "half-width in percent, above 0 and below 100"
            )
        found.append(Wanted(name, width))
    return found


def half_widths(
    curves: Sequence[Friction], levels: Array, hold_s: Array, repeats: int, noise: Noise, polynomial: bool = True
) -> dict[str, float]:
    """Predicted half-width of each parameter at the worst level [%]; of the curve, or of single levels."""
    within = np.array(
        [
            noise.density(curve.Ts) * np.diag(inverse_information(curve, float(hold)))
            for curve, hold in zip(curves, hold_s, strict=True)
        ]
    )
    return _half_widths(within, curves, levels, repeats, noise, polynomial)


def _half_widths(
    within: Array, curves: Sequence[Friction], levels: Array, repeats: int, noise: Noise, polynomial: bool
) -> dict[str, float]:
    result = {}
    t = t_quantile(len(levels) * (repeats - 1))
    values = {"Ts": [c.Ts for c in curves], "tau1": [c.tau1 for c in curves], "tau2": [c.tau2 for c in curves]}
    for name, k in PARAMETERS.items():
        variance = (noise.scatter[k] ** 2 + within[:, k]) / repeats
        if polynomial:
            g = powers(levels, TERMS[name]) / np.array(values[name])[:, None]
            scale = 1 / np.sqrt((g**2).sum(axis=0))
            g = g * scale
            spread = np.linalg.pinv((g / variance[:, None]).T @ g, rcond=1e-14, hermitian=True)
            variance = np.einsum("ij,jk,ik->i", g, spread, g)
        else:
            # scatter that follows a trend over the levels costs degrees of freedom at the ends
            t = t_quantile(max(1.0, len(levels) * (repeats - 1) / 3.5)) if len(levels) > 3 else t
        result[name] = float(100 * np.expm1(np.minimum(t * np.sqrt(variance.max()), 50.0)))
    return result


def plan(
    curve_at: Callable[[float], Friction],
    candidates: Sequence[Sequence[float]],
    wanted: Sequence[Wanted],
    noise: Noise,
    rig: Rig,
    polynomial: bool = True,
) -> Plan:
    """The quickest experiment that reaches every wanted width; where none does, the one that comes nearest.

    `candidates` are the sets of levels to choose from.
    """
    best: tuple[float, Plan] | None = None
    for levels in candidates:
        curves = [curve_at(level) for level in levels]
        duty = np.array(levels)
        for factor in HOLDS:
            hold = np.array([_round(factor * curve.tau2, rig) for curve in curves])
            within = np.array(
                [
                    noise.density(c.Ts) * np.diag(inverse_information(c, float(h)))
                    for c, h in zip(curves, hold, strict=True)
                ]
            )
            for repeats in range(LEAST_REPEATS, MOST_REPEATS + 1):
                widths = _half_widths(within, curves, duty, repeats, noise, polynomial)
                time_s = repeats * float((hold + rig.idle_s + rig.release_s).sum())
                over = max(widths[w.parameter] / w.half_width_pct for w in wanted)
                # an experiment that falls short costs more than any that does not
                price = time_s if over <= 1 else 1e9 * over + time_s
                if best is None or price < best[0]:
                    found = Plan(tuple(levels), tuple(hold.tolist()), repeats, widths, time_s, over <= 1)
                    best = (price, found)
                if over <= 1:
                    break
    assert best is not None
    return best[1]


def _round(hold_s: float, rig: Rig) -> float:
    """Whole seconds, within what the rig and the least record allow."""
    return float(np.ceil(min(max(hold_s, LEAST_HOLD_S), rig.longest_hold_s)))


def level_sets(u_range: tuple[float, float], most: int) -> list[list[float]]:
    """Equally spaced levels over the identified duties, from eight (four more than T_s(u) has terms) to `most`."""
    low, high = u_range
    digits = 0 if high - low >= 3 * most else 1
    return [np.round(np.linspace(low, high, count), digits).tolist() for count in range(min(8, most), most + 1)]


@dataclass(frozen=True)
class Step:
    """One run of the plan."""

    order: int
    level: float
    repeat: int
    idle_s: float
    hold_s: float
    release_s: float


def run_order(found: Plan, rig: Rig, seed: int) -> list[Step]:
    """One block a repeat, each with all levels in an order of its own: no drift or sweep hides in the levels."""
    random = np.random.default_rng(seed)
    steps: list[Step] = []
    for repeat in range(1, found.repeats + 1):
        for i in random.permutation(len(found.levels)):
            steps.append(Step(len(steps) + 1, found.levels[i], repeat, rig.idle_s, found.hold_s[i], rig.release_s))
    return steps


def duty_breaks(steps: Sequence[Step]) -> list[tuple[float, float]]:
    """The whole session as (from when [s], duty [%]), held until the next; the last entry ends it."""
    breaks, now = [], 0.0
    for step in steps:
        breaks.append((now, 0.0))
        breaks.append((now + step.idle_s, step.level))
        breaks.append((now + step.idle_s + step.hold_s, 0.0))
        now += step.idle_s + step.hold_s + step.release_s
    merged = [
        one for one, before in zip(breaks, [None, *breaks], strict=False) if before is None or one[1] != before[1]
    ]
    return [*merged, (now, 0.0)]
