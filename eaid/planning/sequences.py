"""The shortest sequence of inputs that identifies a clutch to wanted widths.

A sequence is levels with holds, and returns to rest between its engagements. Levels and holds are exchanged one by one
for what lowers T φ², φ the worst ratio of a width to the wanted one: the time that repeating the sequence would take to
reach them all.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.estimate.forms import nonlinear
from eaid.estimate.response import Drive
from eaid.estimate.scatter import Noise
from eaid.estimate.spread import t_quantile
from eaid.models.parameters import Nonlinear
from eaid.options import Limits
from eaid.planning.design import PARAMETERS, Designer

MOST_ENGAGEMENTS = 60
BLOCKS = 12  # Instants of each hold at which the sensitivities are taken
RAMP_S = 0.05  # An input whose rate is limited goes in steps this long [s]
COARSE = 4  # Steps of a ramp while sequences are compared; the one that is taken has steps of `RAMP_S`
FULL_DUTY = 100.0  # Highest input of a rig in %


@dataclass(frozen=True, eq=False)
class HoldSequence:
    """Levels and holds, 0 for a rest."""

    input: Array
    hold_s: Array

    @property
    def time_s(self) -> float:
        """Rig time, without ramps."""
        return float(self.hold_s.sum())


def check(limits: Limits) -> None:
    """Refuse limits that mean nothing."""
    faults = []
    low, high = limits.duty
    if not 0 < low < high < np.inf:
        faults.append(f"«limits» duty {low:g}:{high:g}: give two inputs that rise, above 0")
    elif limits.unit == "%" and high > FULL_DUTY:
        faults.append(f"«limits» duty {low:g}:{high:g}: a duty ends at 100 %")
    if not 0 < limits.hold_s[0] < limits.hold_s[1]:
        faults.append(
            f"«limits» hold_s {limits.hold_s[0]:g}:{limits.hold_s[1]:g}: give the shortest and the longest hold"
        )
    if 0 < limits.rate_per_s * limits.hold_s[1] < high:
        faults.append(
            f"«limits» rate_per_s {limits.rate_per_s:g}: a change to {high:g} takes {high / limits.rate_per_s:g} s, "
            "more than the longest hold; give a faster rate or a longer hold"
        )
    if limits.rest_s < 0 or limits.rate_per_s < 0 or limits.work_s < 0 or limits.engagements < 1:
        faults.append("«rest», «limits» rate_per_s and «work» are 0 or more, and there is one engagement at least")
    if faults:
        raise UsageError(*faults)


def refuse_scattered(noise: Noise, wanted: Mapping[str, float]) -> None:
    """Refuse widths that the scatter between engagements keeps out of reach, however many there are."""
    faults = []
    for name, scatter in zip(PARAMETERS, noise.scatter, strict=True):
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


def drive_of_sequence(whole: HoldSequence, limits: Limits) -> Drive:
    """A sequence for the kernel: some instants of each hold, each with the time that it stands for as its weight."""
    changes = breaks_of(whole, limits, COARSE)
    starts, level = np.array(changes[:-1]).T
    hold = np.diff(np.append(starts, changes[-1][0]))
    short = (limits.rate_per_s > 0) & (hold <= 1.5 * RAMP_S)  # the steps of a ramp
    count = np.where(short, 1, BLOCKS)
    of = np.repeat(np.arange(len(hold)), count)
    place = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    edges = [(k / count[of]) ** 2 * hold[of] for k in (place, place + 1)]
    middle, weight = 0.5 * (edges[0] + edges[1]), edges[1] - edges[0]
    t = np.concatenate([starts, starts[of] + middle])
    order = np.argsort(t, kind="stable")
    duty, at = np.unique(level, return_inverse=True)
    return Drive(
        np.append(np.diff(t[order]), 0.0),
        at[np.concatenate([np.arange(len(hold)), of])[order]].astype(np.int64),
        duty,
        np.ones(len(t), dtype=np.int64),
        np.zeros(len(t)),
        np.concatenate([np.zeros(len(hold)), weight])[order],
        False,
        True,
    )


def breaks_of(whole: HoldSequence, limits: Limits, most: int = 10**6) -> tuple[tuple[float, float], ...]:
    """(from when [s], input) with ramps where the rate is limited, in milliseconds; the last entry ends it.

    A ramp has as many steps as `RAMP_S` asks for, `most` of them at most.
    """
    breaks: list[tuple[float, float]] = []
    now, before = 0.0, 0.0
    for duty, hold in zip(whole.input.tolist(), whole.hold_s.tolist(), strict=True):
        if limits.rate_per_s > 0 and duty != before:
            ramp_s = abs(duty - before) / limits.rate_per_s
            count = min(int(np.ceil(ramp_s / RAMP_S)), most)
            for k in range(1, count):
                breaks.append((now, before + (duty - before) * k / count))
                now += max(RAMP_S, ramp_s / most)
        breaks.append((now, duty))
        now = round(now + max(hold, 1e-3), 3)
        before = duty
    merged = [one for k, one in enumerate(breaks) if k == 0 or one[1] != breaks[k - 1][1]]
    return (*merged, (now, 0.0))


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


@dataclass(frozen=True, eq=False)
class ExcitationPlan:
    """A sequence, what it costs and what it is to give."""

    # (from when [s], input in the rig's unit), each held until the next; the last entry ends it
    breaks: tuple[tuple[float, float], ...]
    time_s: float
    engagements: int
    half_width_pct: dict[str, float]  # At the worst duty
    met: bool


def plan_excitation(
    p: Nonlinear, noise: Noise, wanted: Mapping[str, float], limits: Limits | None = None, seed: int = 0
) -> ExcitationPlan:
    """The shortest sequence for half-widths of `wanted` percent at the worst duty, or the best of the longest."""
    limits = limits or Limits(duty=p.u_range)
    check(limits)
    draw = np.random.default_rng(seed)
    judge = Judge(p, noise, dict(wanted), limits)
    segments, best = 16, None
    for _ in range(ROUNDS):
        sequence = judge.improved(judge.random(segments, draw))
        ratio, engaged = judge.ratio(sequence)
        time_s = judge.whole(sequence).time_s
        met = ratio <= MARGIN
        if best is None or _better((met, time_s, ratio), best[0]):
            best = ((met, time_s, ratio), sequence, engaged)
        needed = segments * (ratio / MARGIN) ** 2
        after = int(np.clip(np.ceil(1.02 * needed), 8, 6 * segments))
        if time_s * after / segments > limits.longest_s:
            after = int(segments * limits.longest_s / time_s)
        if after == segments:
            after += 1 if not met else -1
        segments = max(after, 6)
    assert best is not None
    _, sequence, engaged = best
    whole = judge.whole(sequence)
    widths = judge.widths(sequence)
    breaks = breaks_of(whole, limits)
    return ExcitationPlan(
        breaks, breaks[-1][0], engaged, widths, all(widths[name] <= width for name, width in wanted.items())
    )


def _better(one: tuple[bool, float, float], other: tuple[bool, float, float]) -> bool:
    if one[0] != other[0]:
        return one[0]
    return one[1] < other[1] if one[0] else one[2] < other[2]


@dataclass(frozen=True, eq=False)
class Judge:
    """What a sequence is worth."""

    p: Nonlinear
    noise: Noise
    wanted: dict[str, float]
    limits: Limits

    def random(self, segments: int, draw: np.random.Generator) -> HoldSequence:
        """Levels in random order, both ends often, holds log-uniform."""
        low, high = self.limits.duty
        levels = np.linspace(low, high, LEVELS)
        order = np.concatenate([draw.permutation(levels) for _ in range(-(-segments // LEVELS))])[:segments]
        shortest, longest = np.log(self.limits.hold_s).tolist()
        holds = np.exp(draw.uniform(shortest, longest, segments))
        return HoldSequence(order, holds)

    def engagements(self, sequence: HoldSequence) -> int:
        """Stretches under load: as many as asked for, as the longest allows, and as the scatter between them needs."""
        count = self.least_engagements
        if self.limits.work_s > 0:
            count = max(count, int(np.ceil(sequence.time_s / self.limits.work_s)))
        return min(count, len(sequence.hold_s))

    @cached_property
    def least_engagements(self) -> int:
        """As many as asked for, and as the scatter between them needs."""
        count = self.limits.engagements
        for name, scatter in zip(PARAMETERS, self.noise.scatter, strict=True):
            if scatter > 0 and name in self.wanted:
                enough = 0.8 * self.wanted[name] / (100 * scatter)
                while count < MOST_ENGAGEMENTS and of_mean(count) > enough:
                    count += 1
        return count

    def whole(self, sequence: HoldSequence) -> HoldSequence:
        """The sequence with a rest before each engagement."""
        count = self.engagements(sequence)
        ends = np.searchsorted(np.cumsum(sequence.hold_s), np.arange(1, count) * sequence.time_s / count) + 1
        at = np.unique(np.concatenate([[0], ends]))
        return HoldSequence(np.insert(sequence.input, at, 0.0), np.insert(sequence.hold_s, at, self.limits.rest_s))

    def half_widths(self, sequence: HoldSequence) -> Array:
        """Half-widths of log T_s, log τ1, log τ2 at the duties [%], (3, DUTIES); infinite where nothing is known."""
        within, between = self.designer.variances(drive_of_sequence(self.whole(sequence), self.limits))
        half = t_quantile(DEGREES) * np.sqrt(within.sum(axis=2))
        if any(self.noise.scatter):
            half = np.hypot(half, t_quantile(max(between.shape[2] - 1, 1)) * np.sqrt(between.sum(axis=2)))
        return np.asarray(100 * np.expm1(np.minimum(half, 50.0)))

    @cached_property
    def designer(self) -> Designer:
        """Weighs them by the nonlinear model over the duties that the limits allow."""
        model = nonlinear(np.linspace(*self.limits.duty, 11), self.p.C)
        rows = model.rows(np.linspace(*self.limits.duty, DUTIES))[:3]
        return Designer(model, model.unknowns(self.p), rows, self.noise)

    def ratios(self, sequence: HoldSequence) -> Array:
        """Widths over the wanted ones, of those that are wanted, flat."""
        half = self.half_widths(sequence)
        return np.concatenate([half[k] / self.wanted[name] for k, name in enumerate(PARAMETERS) if name in self.wanted])

    def ratio(self, sequence: HoldSequence) -> tuple[float, int]:
        """The worst of them, and the number of engagements."""
        return float(self.ratios(sequence).max()), self.engagements(sequence)

    def widths(self, sequence: HoldSequence) -> dict[str, float]:
        """Half-width at the worst duty [%]."""
        return {name: float(row.max()) for name, row in zip(PARAMETERS, self.half_widths(sequence), strict=True)}

    def price(self, sequence: HoldSequence) -> float:
        """T φ²: the time that would do, if the sequence were repeated."""
        ratios = np.minimum(self.ratios(sequence), 1e6)
        phi = float(np.mean(ratios**POWER)) ** (1 / POWER)
        return float(self.whole(sequence).time_s * phi**2)

    def improved(self, sequence: HoldSequence) -> HoldSequence:
        """Levels and holds exchanged one after another while that lowers the price, and `EFFORT` lasts."""
        levels = np.linspace(*self.limits.duty, LEVELS)
        holds = np.geomspace(*self.limits.hold_s, HOLDS)
        price, left = self.price(sequence), EFFORT // len(sequence.hold_s)
        for _ in range(SWEEPS):
            before = price
            for i in range(len(sequence.hold_s)):
                if left <= 0:
                    return sequence
                near = np.argsort(np.abs(np.log(holds / sequence.hold_s[i])))[:4]
                tried = [(level, sequence.hold_s[i]) for level in levels[:: 2 if len(sequence.hold_s) > 40 else 1]]
                tried += [(sequence.input[i], hold) for hold in holds[near]]
                left -= len(tried)
                for level, hold in tried:
                    inputs, hold_s = sequence.input.copy(), sequence.hold_s.copy()
                    inputs[i], hold_s[i] = level, hold
                    other = HoldSequence(inputs, hold_s)
                    cost = self.price(other)
                    if cost < price:
                        sequence, price = other, cost
            if price > 0.99 * before:
                break
        return sequence
