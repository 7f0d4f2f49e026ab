"""The shortest sequence of inputs that identifies a clutch to wanted widths.

A sequence is levels with holds, and returns to rest between its engagements. Levels and holds are exchanged one by one
for what lowers T φ², φ the worst ratio of a width to the wanted one: the time that repeating the sequence would take to
reach them all.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.estimate.forms import nonlinear
from eaid.estimate.response import Drive
from eaid.estimate.spread import t_quantile
from eaid.models.parameters import Nonlinear
from eaid.options import Limits
from eaid.planning.design import PARAMETERS, Designer
from eaid.results.fit import Noise
from eaid.results.plan import Excitation

MOST_ENGAGEMENTS = 60
BLOCKS = 12  # Instants of each hold at which the sensitivities are taken
FULL_DUTY = 100.0  # Highest input of a rig in %


def refuse_scattered(noise: Noise, wanted: Mapping[str, float]) -> None:
    """Refuse widths that the scatter between engagements keeps out of reach, however many there are."""
    faults = []
    for name in PARAMETERS:
        scatter = noise.scatter[name]
        least = float(100 * np.expm1(scatter * of_mean(MOST_ENGAGEMENTS)))
        if least > wanted.get(name, np.inf):
            faults.append(
                f"«want» {name}={wanted[name]:g}: not reachable in {MOST_ENGAGEMENTS} engagements: {name} scatters by "
                f"{100 * scatter:.3g} % from one to the next, which leaves ± {least:.3g} % at best; want "
                f"{1.5 * least:.2g} % or more"
            )
    if faults:
        raise UsageError(*faults)


def of_mean(count: int) -> float:
    """Half-width of the 95 % interval of the mean of so many values, in their standard deviations."""
    return t_quantile(count - 1 or 1) / float(count**0.5)


# Levels and holds [s], shape (2, n); the level 0 is a rest
Sequence: TypeAlias = Array


def drive_of_sequence(whole: Sequence) -> Drive:
    """A sequence for the kernel: some instants of each hold, each with the time that it stands for as its weight."""
    changes = breaks_of(whole)
    starts, level = np.array(changes[:-1]).T
    edges = (np.arange(BLOCKS + 1) / BLOCKS) ** 2 * np.diff(np.append(starts, changes[-1][0]))[:, None]
    nothing = np.zeros((len(starts), 1))
    t = (starts[:, None] + np.hstack([nothing, 0.5 * (edges[:, 1:] + edges[:, :-1])])).ravel()
    duty, at = np.unique(level, return_inverse=True)
    return Drive(
        np.append(np.diff(t), 0.0), np.repeat(at.astype(np.int64), BLOCKS + 1), duty, np.ones(len(t), dtype=np.int64),
        np.zeros(len(t)), np.hstack([nothing, np.diff(edges)]).ravel(), False, True,
    )  # fmt: skip


def breaks_of(whole: Sequence) -> tuple[tuple[float, float], ...]:
    """(from when [s], input), in milliseconds; the last entry ends it."""
    breaks: list[tuple[float, float]] = []
    now = 0.0
    for level, hold in whole.T.tolist():
        if not breaks or breaks[-1][1] != level:
            breaks.append((now, level))
        now = round(now + max(hold, 1e-3), 3)
    return (*breaks, (now, 0.0))


DUTIES = 10  # Duties at which the widths are wanted, from the lowest to the highest
LEVELS = 13  # Levels that a sequence chooses from
HOLDS = 9  # Holds that it chooses from, log-spaced
POWER = 8  # Of the mean that stands for the worst ratio while levels and holds are exchanged
DEGREES = 20.0  # Degrees of freedom that a recording's intervals are taken to have
SWEEPS = 2
ROUNDS = 5
MARGIN = 0.9  # Widths are planned to this part of the wanted ones: those of a recording scatter about the planned
# Segments whose sensitivities are worked out for one improved sequence, at most: a long one is improved in part
EFFORT = 150_000


def plan_excitation(
    p: Nonlinear, noise: Noise, wanted: Mapping[str, float], limits: Limits | None = None, seed: int = 0
) -> Excitation:
    """The shortest sequence for half-widths of `wanted` percent at the worst duty, or the best of the longest."""
    limits = limits or Limits(duty=p.u_range)
    if limits.unit == "%" and limits.duty[1] > FULL_DUTY:
        raise UsageError(f"«limits» duty {limits.duty[1]:g}: a duty ends at 100 %")
    draw = np.random.default_rng(seed)
    judge = Judge(p, noise, dict(wanted), limits)
    segments, best = 16, None
    for _ in range(ROUNDS):
        sequence = judge.improved(judge.random(segments, draw))
        ratio, time_s = float(judge.ratios(sequence).max()), judge.time_s(sequence)
        met = ratio <= MARGIN
        rank = (not met, time_s if met else ratio)
        if best is None or rank < best[0]:
            best = rank, sequence
        needed = segments * (ratio / MARGIN) ** 2
        after = int(np.clip(np.ceil(1.02 * needed), 8, 6 * segments))
        if time_s * after / segments > limits.longest_s:
            after = int(segments * limits.longest_s / time_s)
        if after == segments:
            after += 1 if not met else -1
        segments = max(after, 6)
    assert best is not None
    sequence = best[1]
    widths = {name: float(row.max()) for name, row in zip(PARAMETERS, judge.half_widths(sequence), strict=True)}
    breaks = breaks_of(judge.whole(sequence))
    return Excitation(
        met=all(widths[name] <= width for name, width in wanted.items()), time_on_rig_s=breaks[-1][0],
        engagements=judge.engagements(sequence), half_width_pct={**widths}, duty=breaks,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Judge:
    """What a sequence is worth."""

    p: Nonlinear
    noise: Noise
    wanted: dict[str, float]
    limits: Limits

    def random(self, segments: int, draw: np.random.Generator) -> Sequence:
        """Levels in random order, both ends often, holds log-uniform."""
        low, high = self.limits.duty
        levels = np.linspace(low, high, LEVELS)
        order = np.concatenate([draw.permutation(levels) for _ in range(-(-segments // LEVELS))])[:segments]
        shortest, longest = np.log(self.limits.hold_s).tolist()
        holds = np.exp(draw.uniform(shortest, longest, segments))
        return np.array([order, holds])

    def engagements(self, sequence: Sequence) -> int:
        """Stretches under load: as many as asked for, as the longest allows, and as the scatter between them needs."""
        count = self.least_engagements
        if self.limits.work_s > 0:
            count = max(count, int(np.ceil(float(sequence[1].sum()) / self.limits.work_s)))
        return min(count, len(sequence[1]))

    @cached_property
    def least_engagements(self) -> int:
        """As many as asked for, and as the scatter between them needs."""
        count = self.limits.engagements
        for name in PARAMETERS:
            scatter = self.noise.scatter[name]
            if scatter > 0 and name in self.wanted:
                enough = 0.8 * self.wanted[name] / (100 * scatter)
                while count < MOST_ENGAGEMENTS and of_mean(count) > enough:
                    count += 1
        return count

    def whole(self, sequence: Sequence) -> Sequence:
        """The sequence with a rest before each engagement."""
        count = self.engagements(sequence)
        levels, holds = sequence
        ends = np.searchsorted(np.cumsum(holds), np.arange(1, count) * float(holds.sum()) / count) + 1
        at = np.unique(np.concatenate([[0], ends]))
        return np.array([np.insert(levels, at, 0.0), np.insert(holds, at, self.limits.rest_s)])

    def time_s(self, sequence: Sequence) -> float:
        """Rig time, rests included."""
        return float(self.whole(sequence)[1].sum())

    def half_widths(self, sequence: Sequence) -> Array:
        """Half-widths of log T_s, log τ1, log τ2 at the duties [%], (3, DUTIES); infinite where nothing is known."""
        within, between = self.designer.variances(drive_of_sequence(self.whole(sequence)))
        half = t_quantile(DEGREES) * np.sqrt(within.sum(axis=2))
        if any(self.noise.scatter.values()):
            half = np.hypot(half, t_quantile(max(between.shape[2] - 1, 1)) * np.sqrt(between.sum(axis=2)))
        return np.asarray(100 * np.expm1(np.minimum(half, 50.0)))

    @cached_property
    def designer(self) -> Designer:
        """Weighs them by the nonlinear model over the duties that the limits allow."""
        model = nonlinear(np.linspace(*self.limits.duty, 11), self.p.C)
        rows = model.rows(np.linspace(*self.limits.duty, DUTIES))[:3]
        return Designer(model, model.unknowns(self.p), rows, self.noise)

    def ratios(self, sequence: Sequence) -> Array:
        """Widths over the wanted ones, of those that are wanted, flat."""
        half = self.half_widths(sequence)
        return np.concatenate([half[k] / self.wanted[name] for k, name in enumerate(PARAMETERS) if name in self.wanted])

    def price(self, sequence: Sequence) -> float:
        """T φ²: the time that would do, if the sequence were repeated."""
        ratios = np.minimum(self.ratios(sequence), 1e6)
        phi = float(np.mean(ratios**POWER)) ** (1 / POWER)
        return float(self.time_s(sequence) * phi**2)

    def improved(self, sequence: Sequence) -> Sequence:
        """Levels and holds exchanged one after another while that lowers the price, and `EFFORT` lasts."""
        n = sequence.shape[1]
        levels = np.linspace(*self.limits.duty, LEVELS)[:: 2 if n > 40 else 1]
        holds = np.geomspace(*self.limits.hold_s, HOLDS)
        price, left = self.price(sequence), EFFORT // n
        for _ in range(SWEEPS):
            before = price
            for i in range(n):
                if left <= 0:
                    return sequence
                near = np.argsort(np.abs(np.log(holds / sequence[1, i])))[:4]
                tried = [(level, sequence[1, i]) for level in levels]
                tried += [(sequence[0, i], hold) for hold in holds[near]]
                left -= len(tried)
                for exchanged in tried:
                    other = sequence.copy()
                    other[:, i] = exchanged
                    cost = self.price(other)
                    if cost < price:
                        sequence, price = other, cost
            if price > 0.99 * before:
                break
        return sequence
