"""The shortest sequence of inputs that identifies a clutch to wanted widths.

A sequence is levels with holds, and returns to rest between its engagements. Levels and holds are exchanged one by one
for what lowers T φ², φ the worst ratio of a width to the wanted one: the time that repeating the sequence would take to
reach them all.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.control.defaults import counted_from_rest
from eaid.declared import keyed, pairs
from eaid.errors import DataError, UsageError
from eaid.estimate.forms import nonlinear
from eaid.estimate.recorded_log import RecordedLog
from eaid.estimate.spread import t_quantile
from eaid.findings import finding
from eaid.options import Limits, PlanOptions
from eaid.planning.kinds import PARAMETERS, Sensitivities, falls_of, is_clutch
from eaid.planning.recordings import RATE_HZ, simulated_disturbance
from eaid.planning.widths import Widths, fitted_rig, percent, relative_rows, settled, wanting
from eaid.plant.drive import Drive
from eaid.plant.dynamics import Plant
from eaid.plant.respond import driven
from eaid.recorded.curve_intervals import held_curves
from eaid.recorded.from_logs import finish, setup_of
from eaid.recorded.log_intervals import spread
from eaid.results.fit import Fit
from eaid.results.models import Noise
from eaid.results.plan import Excitation
from eaid.synth.logs import read_sensor, scatter
from eaid.synth.plants import clutch

MOST_ENGAGEMENTS = 60
HOLD_INSTANTS = 12  # Instants of each hold at which the sensitivities are taken
FULL_DUTY = 100.0  # Highest input of a rig in %
WIDTH_INPUTS = 10  # Duties at which the widths are wanted, from the lowest to the highest
# Slowest time constant of a rig that the usual holds are made for [s], and times by which that of another differs that
# has holds of its own
USUAL_SLOWEST_S, ANOTHER_PACE = 10.0, 5.0
LEVELS = 13  # Levels that a sequence chooses from
HOLDS_TRIED = 9  # Holds that it chooses from, log-spaced
MEAN_POWER = 8  # Of the mean that stands for the worst ratio while levels and holds are exchanged
PLANNED_DEGREES = 20.0  # Degrees of freedom that a recording's intervals are taken to have
SWEEPS = 2  # Times that all levels and holds of a sequence are exchanged
EXCHANGE_ROUNDS = 5  # Lengths of a sequence that are tried
MARGIN = 0.9  # Widths are planned to this part of the wanted ones: those of a recording scatter about the planned
# Segments whose sensitivities are worked out for one improved sequence, at most: a long one is improved in part
EFFORT = 150_000
# Recordings that are simulated of each sequence, and the probability that a recording keeps a width: 19 of 20 do
SEQUENCE_SETS, SEQUENCE_KEEPING = 20, 19 / 21


def refuse_scattered(noise: Noise, wanted: Mapping[str, float]) -> None:
    """Refuse widths that the scatter between engagements keeps out of reach, however many there are."""
    least = {name: float(100 * np.expm1(noise.scatter[name] * of_mean(MOST_ENGAGEMENTS))) for name in wanted}
    if faults := [
        f"«want» {name}={width:g}: not reachable in {MOST_ENGAGEMENTS} engagements: {name} scatters by "
        f"{100 * noise.scatter[name]:.3g} % from one to the next, which leaves ± {least[name]:.3g} % at best; want "
        f"{1.5 * least[name]:.2g} % or more"
        for name, width in wanted.items()
        if least[name] > width
    ]:
        raise UsageError(*faults)


def of_mean(count: int) -> float:
    """Half-width of the 95 % interval of the mean of so many values, in their standard deviations."""
    return float(t_quantile(count - 1 or 1) / count**0.5)


def drive_of_sequence(whole: Array) -> Drive:
    """A sequence for the kernel: some instants of each hold, each with the time that it stands for as its weight."""
    changes = breaks_of(whole)
    starts, level = np.array(changes[:-1]).T
    edges = (np.arange(HOLD_INSTANTS + 1) / HOLD_INSTANTS) ** 2 * np.diff(np.append(starts, changes[-1][0]))[:, None]
    nothing = np.zeros((len(starts), 1))
    t = (starts[:, None] + np.hstack([nothing, 0.5 * (edges[:, 1:] + edges[:, :-1])])).ravel()
    log = RecordedLog("planned", t, np.repeat(level, HOLD_INSTANTS + 1), np.zeros(len(t)), idle_start=True)
    return log.drive._replace(w=np.hstack([nothing, np.diff(edges)]).ravel())


def breaks_of(whole: Array) -> tuple[tuple[float, float], ...]:
    """(from when [s], input), in milliseconds; the last entry ends it."""
    breaks: list[tuple[float, float]] = []
    now = 0.0
    for level, hold in whole.T.tolist():
        if not breaks or breaks[-1][1] != level:
            breaks.append((now, level))
        now = round(now + max(hold, 1e-3), 3)
    return (*breaks, (now, 0.0))


def plan_excitation(p: Plant, noise: Noise, wanted: Mapping[str, float], limits: Limits, seed: int = 0) -> Excitation:
    """The shortest sequence for half-widths of `wanted` percent at the worst duty, or the best of the longest."""
    if limits.unit == "%" and limits.duty[1] > FULL_DUTY:
        raise UsageError(f"«limits» duty {limits.duty[1]:g}: a duty ends at 100 %")
    draw = np.random.default_rng(seed)
    judge = Judge(p, noise, dict(wanted), limits)
    segments, best = 16, None
    for _ in range(EXCHANGE_ROUNDS):
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
    """What a sequence is worth: levels and holds [s], shape (2, n); the level 0 is a rest."""

    p: Plant
    noise: Noise
    wanted: dict[str, float]
    limits: Limits

    def random(self, segments: int, draw: np.random.Generator) -> Array:
        """Levels in random order, both ends often, holds log-uniform."""
        low, high = self.limits.duty
        levels = np.linspace(low, high, LEVELS)
        order = np.concatenate([draw.permutation(levels) for _ in range(-(-segments // LEVELS))])[:segments]
        shortest, longest = np.log(self.limits.hold_s).tolist()
        holds = np.exp(draw.uniform(shortest, longest, segments))
        return np.array([order, holds])

    def engagements(self, sequence: Array) -> int:
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

    def whole(self, sequence: Array) -> Array:
        """The sequence with a rest before each engagement."""
        count = self.engagements(sequence)
        levels, holds = sequence
        ends = np.searchsorted(np.cumsum(holds), np.arange(1, count) * float(holds.sum()) / count) + 1
        at = np.unique(np.concatenate([[0], ends]))
        return np.array([np.insert(levels, at, 0.0), np.insert(holds, at, self.limits.rest_s)])

    def time_s(self, sequence: Array) -> float:
        """Rig time, rests included."""
        return float(self.whole(sequence)[1].sum())

    def half_widths(self, sequence: Array) -> Array:
        """Half-widths of log T_s, log τ1, log τ2 at the duties [%], (3, DUTIES); infinite where nothing is known."""
        within, between = self.known.variances(self.noise, drive_of_sequence(self.whole(sequence)))
        half = t_quantile(PLANNED_DEGREES) * np.sqrt(within.sum(axis=2))
        if any(self.noise.scatter.values()):
            half = np.hypot(half, t_quantile(max(between.shape[2] - 1, 1)) * np.sqrt(between.sum(axis=2)))
        return np.asarray(100 * np.expm1(np.minimum(half, 50.0)))

    @cached_property
    def known(self) -> Sensitivities:
        """The nonlinear model over the duties that the limits allow."""
        model = nonlinear(np.linspace(*self.limits.duty, 11), self.p.C)
        rows = model.rows(np.linspace(*self.limits.duty, WIDTH_INPUTS))[:3]
        unknowns, own = model.unknowns(self.p), falls_of(self.p)
        every, slopes = np.concatenate([unknowns, *own.values()]), relative_rows(rows, unknowns)
        return Sensitivities(model, every, slopes, tuple(own), self.p.release_as_left)

    def ratios(self, sequence: Array) -> Array:
        """Widths over the wanted ones, of those that are wanted, flat."""
        half = self.half_widths(sequence)
        return np.concatenate([half[k] / self.wanted[name] for k, name in enumerate(PARAMETERS) if name in self.wanted])

    def price(self, sequence: Array) -> float:
        """T φ²: the time that would do, if the sequence were repeated."""
        ratios = np.minimum(self.ratios(sequence), 1e6)
        phi = float(np.mean(ratios**MEAN_POWER)) ** (1 / MEAN_POWER)
        return float(self.time_s(sequence) * phi**2)

    def improved(self, sequence: Array) -> Array:
        """Levels and holds exchanged one after another while that lowers the price, and `EFFORT` lasts."""
        n = sequence.shape[1]
        levels = np.linspace(*self.limits.duty, LEVELS)[:: 2 if n > 40 else 1]
        holds = np.geomspace(*self.limits.hold_s, HOLDS_TRIED)
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


def recording_widths(
    plan: Excitation, p: Plant, noise: Noise, k: int, seed: int = 0, rate_hz: float = RATE_HZ
) -> Widths:
    """Half-widths [%] at the worst duty, as the `k`-th recording tells them where its fit to the log ends.

    It is one log of the sequence; each engagement, from its rest on, has a scatter of its own.
    """
    draw, plant, disturbance = np.random.default_rng(seed + 7919 * k), clutch(p), simulated_disturbance(noise, rate_hz)
    time_s = np.arange(round(plan.time_on_rig_s * rate_hz)) / rate_hz
    start, duty = np.array(plan.duty[:-1]).T
    place = np.searchsorted(start, time_s, side="right") - 1
    engagement = np.cumsum(duty == 0)[place]
    torque = np.empty_like(time_s)
    for number in np.unique(engagement):
        part = engagement == number
        torque[part] = driven(plant.acting(scatter(disturbance, draw)), start, duty, time_s)[part]
    output = read_sensor(torque, time_s, np.zeros_like(time_s), disturbance, draw)
    duties = np.linspace(*p.u_range, WIDTH_INPUTS)
    model = nonlinear(duties, p.C)
    own = falls_of(p)
    setup = setup_of(model, [RecordedLog("planned", time_s, duty[place], output)])
    setup = replace(setup, extras=tuple(own), falls_as_left=p.release_as_left)  # as the fit of such a log has them
    start = np.concatenate([model.unknowns(p), *own.values()])
    solved = finish(setup, [np.append(start, np.zeros(setup.size - len(start)))])
    known, slopes = spread(solved), setup.slopes(duties)
    half = np.apply_along_axis(known.of, 2, slopes) / (slopes @ solved.x)
    unknown = [name in held_curves(solved) for name in PARAMETERS]
    return dict(zip(PARAMETERS, percent(np.where(unknown, np.inf, half.max(axis=1))).tolist(), strict=True))


def shortest_recording(fit: Fit, options: PlanOptions, progress: Callable[[], None]) -> Excitation:
    """The shortest sequence that identifies a fit's plant to the wanted widths: `eaid.plan(fit, excitation=True)`.

    `UsageError` for a width of no parameter or one that the scatter keeps out of reach, and for limits that leave
    nothing; `DataError` for a fit without a nonlinear model.
    """
    options = wanting(options, {"Ts": 1.0, "tau1": 4.0, "tau2": 13.0})
    if fit.nonlinear is None and fit.plant_ is None:
        raise DataError("the fit holds no nonlinear model, which a sequence is planned with; fit clutch logs with it")
    rig = fitted_rig(fit)
    if not is_clutch(plant := fit.plant):
        raise DataError(
            f"a sequence is planned for the clutch's two lags, and the fit's plant is of the kind {plant.kind}"
            f"{' with a dead time' * (plant.dead_time_s > 0)}; plan steps, without «excitation»"
        )
    refuse_scattered(rig.noise, options.want)
    slowest_s = plant.slowest_s(np.array(plant.u_range))
    pace = slowest_s / USUAL_SLOWEST_S
    pace = 1.0 if 1 / ANOTHER_PACE <= pace <= ANOTHER_PACE else pace
    limits = limits_of(options, plant.u_range, rig.plant.input_unit, pace)
    noise, seed = rig.noise, options.seed
    plan, worst, width = settled(  # longer until 19 of 20 recordings keep what is wanted
        partial(plan_excitation, plant, noise, limits=limits, seed=seed),
        lambda plan, k: recording_widths(plan, plant, noise, k, seed, RATE_HZ / pace),
        options, SEQUENCE_SETS, SEQUENCE_KEEPING, progress,
    )  # fmt: skip
    findings = counted_from_rest(fit, fit.plant.u_range)
    findings += rig.told
    if not plan.met:
        findings.append(finding(
            "excitation-short", "plan", most_s=plan.time_on_rig_s, parameter=worst,
            width_pct=width if width < np.inf else None, wanted_pct=options.want[worst],
        ))  # fmt: skip
    steps = replace(rig, levels=limits.duty).quickest(options.want, PlanOptions())
    more = {"classic_time_on_rig_s": steps.time_on_rig_s if steps.met else None, "findings": tuple(findings)}
    sequence: Excitation = msgspec.structs.replace(plan, input_unit=rig.plant.input_unit, **more)
    return sequence


def limits_of(options: PlanOptions, duty: tuple[float, float], unit: str, pace: float) -> Limits:
    """What the rig allows; by itself inputs within `duty`, and holds, rests and lengths by the plant's pace."""
    if isinstance(options.limits, Limits):
        return options.limits
    usual = Limits()
    paced = {"hold_s": tuple(pace * end for end in usual.hold_s), "rest_s": pace * usual.rest_s}
    given = {"duty": duty, "longest_s": max(pace * usual.longest_s, 1.0), **paced, **pairs("«limits»", options.limits)}
    return replace(keyed(Limits, "«limits»", given), unit=unit)
