"""What to record next: levels, hold times and repeats that bring chosen intervals below a wanted width.

The width is predicted as the intervals themselves are found: V = (a + h)/R per level, the curve's variance
g'(Σ g g'/V)⁻¹g, Student's t with L(R − 1) degrees of freedom. Of all experiments on a grid of hold times, numbers of
levels and repeats, the one that takes the least time on the rig is taken.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import Friction
from eaid.uncertainty.curve import powers
from eaid.uncertainty.level_statistics import TERMS
from eaid.uncertainty.rig_noise import Noise
from eaid.uncertainty.student_t import t_quantile

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
    within: Array, curves: Sequence[Friction], levels: Array, repeats: int, noise: Noise, polynomial: bool = True
) -> dict[str, float]:
    """Predicted half-width of each parameter at the worst level [%]; of the curve, or of single levels.

    `within` is what `within_runs` gives for the holds, shape (L, 3).
    """
    result = {}
    t = t_quantile(len(levels) * (repeats - 1))
    for name, k in PARAMETERS.items():
        variance = (noise.scatter[k] ** 2 + within[:, k]) / repeats
        if polynomial:
            g = powers(levels, TERMS[name]) / np.array([getattr(curve, name) for curve in curves])[:, None]
            scale = 1 / np.sqrt((g**2).sum(axis=0))
            g = g * scale
            spread = np.linalg.pinv((g / variance[:, None]).T @ g, rcond=1e-14, hermitian=True)
            variance = np.einsum("ij,jk,ik->i", g, spread, g)
        else:
            # scatter that follows a trend over the levels costs degrees of freedom at the ends
            t = t_quantile(max(1.0, len(levels) * (repeats - 1) / 3.5)) if len(levels) > 3 else t
        result[name] = float(100 * np.expm1(np.minimum(t * np.sqrt(variance.max()), 50.0)))
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
    for levels in candidates:
        curves = [curve_at(level) for level in levels]
        duty = np.array(levels)
        for factor in HOLDS:
            # whole seconds, within what the rig and the least record allow
            hold = np.ceil([min(max(factor * c.tau2, LEAST_HOLD_S), session.longest_hold_s) for c in curves])
            within = within_runs(curves, hold, noise)
            for repeats in range(LEAST_REPEATS, MOST_REPEATS + 1):
                widths = half_widths(within, curves, duty, repeats, noise, polynomial and len(levels) > 1)
                time_s = repeats * float((hold + session.idle_s + session.release_s).sum())
                over = max(widths[name] / width for name, width in wanted.items())
                # an experiment that falls short costs more than any that does not
                price = time_s if over <= 1 else 1e9 * over + time_s
                if best is None or price < best[0]:
                    best = price, Experiment(tuple(levels), tuple(hold.tolist()), repeats, widths, time_s, over <= 1)
                if over <= 1:
                    break
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
