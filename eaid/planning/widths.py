"""What recordings of a rig would tell, and the quickest steps from rest that tell what is wanted.

Steps from rest and sequences of one recording are weighed alike (`kinds.Sensitivities`). Of steps, on a grid of hold
times, numbers of levels and repeats, the experiment that takes the least time on the rig is taken; its degrees of
freedom are those of the runs that make a curve there (Satterthwaite).
"""

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Any, TypeVar

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError, UsageError
from eaid.estimate.draw import draw
from eaid.estimate.forms import friction, nonlinear
from eaid.estimate.scatter import ASSUMED, LEVELS_TO_SPARE, weigh_neighbours
from eaid.estimate.spread import satterthwaite, t_quantile
from eaid.findings import Finding, finding
from eaid.options import PlanOptions
from eaid.planning.kinds import NUMBERS_OF_KIND, PARAMETERS, Sensitivities, is_clutch, refuse_unplanned, steps_of
from eaid.plant.drive import ROW_NUMBER, Drive
from eaid.plant.dynamics import SHARE
from eaid.recorded.engagements import FEWEST_ENGAGEMENTS
from eaid.results.fit import Fit
from eaid.results.models import FrictionLevel, Noise
from eaid.results.plan import Plan
from eaid.synth.plants import Specimen, clutch, of_model

# Hold times tried, in units of each level's τ2: a record of about τ2 or less does not determine it
HOLD_FACTORS = (1.5, 2.0, 3.0, 4.0)
LEAST_HOLD_S = 5.0
RELEASE_S, LONGEST_HOLD_S, RESTS_AFTER = 10.0, 120.0, 5  # By themselves; time constants until rest
# Part of the lowest level's T_s that the slow part of the highest leaves of it, and the longest rest for that [s]
LEFT_OF_LEAST, LONGEST_REST_S = 0.005, 60.0
LEAST_REPEATS, MOST_REPEATS = 3, 20
KEEPING = 0.8  # Probability with which a session keeps a width that a plan promises
# Share of the draws that must keep a promised T_s, τ1, τ2 for that: what sessions have beyond the draws (ends by score
# tests, scatter of levels) was measured (`benchmarks.plans`)
KEPT_SHARES = (0.92, 0.77, 0.81)
SESSION_DRAWS = 200  # Draws behind that
UNTOLD = 1e6  # A half-width above which nothing is told [%]
STEP_INSTANTS = 60  # Of each hold, at which the sensitivities are taken
PER_TURN, MOST_INSTANTS = 40, 2000  # Of what rings, in a turn of its frequency and at most
ENDLESS_REST_S = 1e9  # A rest that leaves nothing in the states [s]
NARROWER_POWER = 0.7  # Power of the excess by which a plan is asked for narrower: widths fall faster than predicted
# Least factor by which a width that was not kept is asked for narrower, to the power of how often it was not; and the
# excess that counts at most
LEAST_NARROWER, MOST = 1.03, 3.0
PLAN_ROUNDS, SMALLER_ROUNDS = 6, 2  # Times that a plan is made larger, and that one between it and the last is tried
# Half-width of the 95 % interval at the worst input [%], by parameter; infinite where there is none
Widths = dict[str, float]
# A plan, of steps or of one recording: `met` says whether its predicted widths, `half_width_pct`, are those wanted
P = TypeVar("P", bound=Any)


def relative_rows(rows: Array, unknowns: Array) -> Array:
    """Slopes of the logarithms of numbers that are linear in the unknowns."""
    return np.asarray(rows / (rows @ unknowns)[:, :, None])


def percent(half: Array) -> Array:
    """Half-widths of logarithms in percent; infinite above `UNTOLD`."""
    found = 100 * np.expm1(np.minimum(half, 50.0))
    return np.where(found < UNTOLD, found, inf)


def drive_of_steps(
    levels: Sequence[float], hold_s: Array, rests_s: tuple[float, float] | None = None, turn_s: float = inf
) -> Drive:
    """A step from rest to each level, in a few instants of its hold that stand for the time about them.

    Where `rests_s` are recorded, the idle before a step and its release count too, and the idle output is not known.
    What rings has a turn's time.
    """
    duty, index = np.unique([0.0, *levels], return_inverse=True)
    idle_s, release_s = rests_s or (0.0, 0.0)
    pieces: list[tuple[int, Array, Array]] = []  # Place of the input, times between instants, time each stands for
    for k, hold in enumerate(hold_s.tolist()):
        pieces += [(0, np.ones(1), np.array([idle_s])), (index[k + 1], *instants(hold, turn_s))]
        pieces += [(0, *instants(release_s, turn_s))] if release_s else []
        pieces.append((0, np.array([ENDLESS_REST_S]), np.zeros(1)))
    places, dt_s, weights = zip(*pieces, strict=True)
    acts = np.repeat(np.array(places, dtype=ROW_NUMBER), [len(one) for one in dt_s])
    nothing, up = np.zeros(len(acts)), np.ones(len(acts), dtype=ROW_NUMBER)
    return Drive(np.concatenate(dt_s), acts, duty, duty, up, nothing, np.concatenate(weights), rests_s is None, True)


def instants(time_s: float, turn_s: float) -> tuple[Array, Array]:
    """Times between the instants of a stretch, from its begin to its end, and the time that each stands for [s]."""
    edges = np.concatenate([[0.0], np.geomspace(1e-4 * time_s, time_s, STEP_INSTANTS)])
    if turn_s < inf:
        edges = np.linspace(0.0, time_s, int(np.clip(PER_TURN * time_s / turn_s, STEP_INSTANTS, MOST_INSTANTS)) + 1)
    at = np.concatenate([[0.0], 0.5 * (edges[1:] + edges[:-1]), [time_s]])
    return np.diff(at), np.append(0.0, np.diff(edges))


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


def enlarged(
    make: Callable[[Mapping[str, float]], P], measure: Callable[[P], list[Widths]], wanted: Mapping[str, float],
    keeping: float,
) -> tuple[P, Widths]:  # fmt: skip
    """The plan that `make` gives for the wanted widths [%], larger until each is kept with probability `keeping`.

    A width measured too wide is asked for narrower in the next round. A plan that falls short even by its prediction
    is as large as the limits allow, and stays; so does the second that gives none of its simulated recordings a wanted
    interval. One that is large enough may be too large: those between it and the last are tried. Returned with it is
    what is kept: its simulated widths count, and those of the plans before it as far from its prediction as they were
    from their own.
    """
    widths = dict(wanted)
    plan = make(widths)
    rows = measure(plan)
    endless, short = 0, dict[str, float]()  # The widths of the last plan that fell short
    for times in range(1, PLAN_ROUNDS + 1):
        kept = kept_widths(rows, keeping)
        endless += any(min(row[name] for row in rows) == inf for name in wanted)
        excess = {name: kept[name] / width for name, width in wanted.items()}
        if not plan.met or max(excess.values()) <= 1 or endless > 1:
            break
        short = dict(widths)
        for name, ratio in excess.items():
            if ratio > 1:
                widths[name] /= max(LEAST_NARROWER**times, min(ratio, MOST) ** NARROWER_POWER)
        larger = make(widths)
        if larger != plan:
            plan, rows = larger, _carry_widths(plan, rows, larger) + measure(larger)
    for _ in range(SMALLER_ROUNDS):
        kept = kept_widths(rows, keeping)
        between = {name: (width * short[name]) ** 0.5 for name, width in widths.items()} if short else widths
        if any(kept[name] > width for name, width in wanted.items()):
            break
        if not (smaller := make(between)).time_on_rig_s < plan.time_on_rig_s:
            break
        of_smaller = _carry_widths(plan, rows, smaller) + measure(smaller)
        if all(kept_widths(of_smaller, keeping)[name] <= width for name, width in wanted.items()):
            plan, rows, widths = smaller, of_smaller, between
        else:
            short = between
    return plan, kept_widths(rows, keeping)


def _carry_widths(plan: Any, rows: Sequence[Widths], other: Any) -> list[Widths]:
    """Widths of a plan's recordings as far from another's prediction as they were from its own."""
    known = {name: width for name, width in plan.half_width_pct.items() if 0 < width < inf}
    scale = {name: other.half_width_pct[name] / width for name, width in known.items()}
    # a width without end says that this plan was too small, and nothing of the other
    ended = [row for row in rows if max(row.values()) < inf]
    return [{name: width * scale.get(name, 1.0) for name, width in row.items()} for row in ended]


def kept_widths(rows: Sequence[Widths], keeping: float) -> Widths:
    """The width that the next recording keeps with probability `keeping`, each parameter by itself."""
    place = ceil(keeping * (len(rows) + 1) - 1e-9) - 1
    return {name: sorted(row[name] for row in rows)[place] for name in rows[0]}


def settled(
    make: Callable[[Mapping[str, float]], P], measure: Callable[[P, int], Widths], options: PlanOptions,
    sets: int, keeping: float, progress: Callable[[], None],
) -> tuple[P, str, float]:  # fmt: skip
    """A plan as its result, by simulations or by prediction; the parameter furthest from its width, and this width."""

    def simulated(plan: P) -> list[Widths]:
        rows = []
        for k in range(sets):
            rows.append(measure(plan, k))
            progress()
        return rows

    plan, kept = enlarged(make, simulated, options.want, keeping) if options.check else (make(options.want), None)
    widths = kept or plan.half_width_pct
    worst = max(options.want, key=lambda name: widths[name] / options.want[name])
    made = msgspec.structs.replace(
        plan, seed=options.seed, wanted=dict(options.want), met=widths[worst] <= options.want[worst],
        half_width_pct=as_told(plan.half_width_pct), measured_half_width_pct=None if kept is None else as_told(kept),
    )  # fmt: skip
    return made, worst, widths[worst]


def as_told(widths: Mapping[str, float]) -> dict[str, float | None]:
    """Widths as a result holds them: None where there is no interval."""
    return {name: width if width < inf else None for name, width in widths.items()}


def wanting(options: PlanOptions, widths: Mapping[str, float]) -> PlanOptions:
    """The options, with these half-widths [%] where none are wanted; `UsageError` for widths that mean nothing, which
    are those of other parameters, too."""
    options = replace(options, want=options.want or widths)
    wrong = [name for name, width in options.want.items() if name not in widths or not 0 < width < 100]
    if wrong:
        raise UsageError(
            f"«want» {', '.join(wrong)}: give a parameter of {', '.join(widths)} and a half-width in percent, "
            f"above 0 and below 100, as in {','.join(f'{name}={width:g}' for name, width in widths.items())}"
        )
    return options


@dataclass(frozen=True)
class FittedRig:
    """A fit's plant, and the noise and scatter of its runs."""

    fit: Fit
    plant: Specimen
    levels: Sequence[float]  # The identified range of a clutch; the fitted levels of a friction experiment
    share: float  # C
    noise: Noise
    known: bool  # Whether the fit says how noisy the rig is; else the noise is assumed
    most: int = MOST_REPEATS

    @property
    def told(self) -> list[Finding]:
        """What of its noise and scatter was assumed."""
        if not self.known:
            return [finding("plan-assumes-noise", "plan")]
        return [finding("plan-assumes-scatter", "plan")] if self.noise.scatter is ASSUMED.scatter else []

    @property
    def numbers(self) -> tuple[str, ...]:
        """What widths are told of."""
        p = self.plant.model
        return PARAMETERS if p is None else NUMBERS_OF_KIND.get(p.kind, PARAMETERS)

    @property
    def degrees(self) -> float:
        """Degrees of freedom that the scatter is known by; 0: none are known."""
        return (self.fit.uncertainty.degrees_of_freedom if self.fit.uncertainty is not None else None) or 0.0

    @property
    def settles_s(self) -> float:
        """When a step has settled [s]: of a clutch its fast part, as the slow one may be without end."""
        p = self.plant.model
        if p is None or is_clutch(p):
            slowest = max(self.plant.at(level).tau1 for level in self.levels)
        else:
            slowest = p.slowest_s(np.array(self.levels))
        return RESTS_AFTER * slowest + (0.0 if p is None else p.dead_time_s)

    @property
    def lets_go_s(self) -> float:
        """How long a clutch rests until the slow part of the highest level is little beside the lowest [s]."""
        if self.plant.model is not None and not is_clutch(self.plant.model):
            return 0.0
        low, top = self.plant.at(min(self.levels)), self.plant.at(max(self.levels))
        tau2 = low.tau2 if self.fit.release is None else self.fit.release.tau2
        left = (1 - self.share) * top.Ts / max(LEFT_OF_LEAST * low.Ts, 1e-300)
        most = max((LONGEST_REST_S, *self.fit.data.record_s))  # a slow part that no record shows has no end
        return min(tau2 * float(np.log(max(left, 1.0))), most)

    def rests(self, session: PlanOptions) -> tuple[float, float]:
        """How long a run idles before its step and is recorded after its release [s]."""
        by_itself = max(RELEASE_S, ceil(self.settles_s), ceil(self.lets_go_s - session.idle_s))
        return session.idle_s, by_itself if session.release_s is None else session.release_s

    def longest_s(self, session: PlanOptions) -> float:
        """The longest hold [s]; UsageError for one that ends before the output answers."""
        late = 0.0 if self.plant.model is None else self.plant.model.dead_time_s
        if session.longest_hold_s is None:
            return max(LONGEST_HOLD_S, ceil(self.settles_s))
        if session.longest_hold_s <= late:
            raise UsageError(f"«longest_hold_s» {session.longest_hold_s:g}: the output answers after {late:.4g} s")
        return session.longest_hold_s

    def quickest(self, wanted: Mapping[str, float], session: PlanOptions) -> Plan:
        """The quickest steps from rest for the wanted half-widths [%]; where none reaches them, what comes nearest."""
        best, least = Plan(), inf
        several, longest_s, resting_s = self.plant.model is not None, self.longest_s(session), sum(self.rests(session))
        for levels in level_sets(self.levels, session.most_levels) if several else [list(self.levels)]:
            for factor in HOLD_FACTORS:
                hold = self.holds(levels, factor, longest_s)
                repeats, half = self.fewest(levels, hold, wanted, session)
                time_s = repeats * float((hold + resting_s).sum())
                over = max(half[name] / width for name, width in wanted.items())
                # an experiment that falls short costs more than any that does not
                price = time_s if over <= 1 else 1e9 * over + time_s
                if not best.levels or price < least:
                    least = price
                    best = Plan(
                        met=over <= 1, levels=tuple(levels), hold_s=tuple(hold.tolist()), repeats=repeats,
                        time_on_rig_s=time_s, input_unit=self.plant.input_unit, half_width_pct={**half},
                    )  # fmt: skip
        return best

    def holds(self, levels: Sequence[float], factor: float, longest_s: float) -> Array:
        """Hold of each level [s], so many of the longest time constants behind a dead time; of a clutch in whole
        seconds, five at least."""
        if (p := self.plant.model) is None or is_clutch(p):
            slowest = np.array([self.plant.at(level).tau2 for level in levels])
            late = 0.0 if p is None else p.dead_time_s
            return np.ceil(np.minimum(np.maximum(factor * slowest, LEAST_HOLD_S) + late, longest_s))
        hold = p.dead_time_s + 2 * factor * p.slowest_s(np.array(levels))
        digit = 10.0 ** np.floor(np.log10(hold) - 1)
        return np.full(len(levels), min(round(float(np.ceil(hold / digit) * digit), 9), longest_s))

    def fewest(
        self, levels: Sequence[float], hold_s: Array, wanted: Mapping[str, float], session: PlanOptions
    ) -> tuple[int, Widths]:
        """The fewest repeats for the wanted half-widths [%], or the most there are, and what they give."""
        within, between = self.contributions(levels, hold_s, session)
        half: dict[int, Widths] = {}

        def enough(repeats: int) -> bool:
            half[repeats] = self.kept(within, between, repeats, levels)
            return repeats == self.most or all(half[repeats][name] <= width for name, width in wanted.items())

        counts = range(LEAST_REPEATS, self.most + 1)
        fewest = counts[bisect_left(counts, True, key=enough)]
        return fewest, half[fewest]

    def contributions(self, levels: Sequence[float], hold_s: Array, session: PlanOptions) -> tuple[Array, Array]:
        """What noise and scatter of one run at each level contribute to the logarithms at each, (3, m, L)."""
        u, p = np.array(levels), self.plant.model
        if p is not None and not is_clutch(p):
            turn_s = inf if p.zeta is None else 2 * np.pi * p.tau1[0]
            return steps_of(p, u).variances(self.noise, drive_of_steps(levels, hold_s, self.rests(session), turn_s))
        curves = [self.plant.at(level) for level in levels]
        Ts, tau1, tau2 = (np.maximum([getattr(curve, name) for curve in curves], 1e-300) for name in PARAMETERS)
        model, unknowns = friction(u, self.share), np.concatenate([Ts, tau1, tau2])
        rows = model.rows(u)[:3]
        if p is not None:  # levels first: τ1(u), τ2(u), T_s of each level, and T_s(u) through them
            whole = nonlinear(u, self.share)
            model = replace(whole, Ts=model.Ts)
            unknowns = np.concatenate([Ts, whole.unknowns(p)[whole.slices[0].stop :]])
            rows, relative = model.rows(u)[:3], whole.rows(u)[0, :, whole.slices[0]] / Ts[:, None]
            rows[0, :, : len(u)] = Ts[:, None] * relative @ np.linalg.pinv(relative) / Ts
        drive = drive_of_steps(levels, hold_s - (0.0 if p is None else p.dead_time_s))
        known = Sensitivities(model, unknowns, relative_rows(rows, unknowns))
        return known.variances(self.noise, drive, np.repeat(1 / Ts**2, STEP_INSTANTS))

    def kept(self, within: Array, between: Array, repeats: int, levels: Sequence[float]) -> Widths:
        """Half-widths at the worst level that four of five sessions keep [%], of `contributions`.

        A session shows the variance Σ_l v_l χ²_l/(R − 1); the scatter is known by the fit's own χ². Where levels seem
        to scatter about T_s(u), by e = χ²/ν − 1 of what their runs do, T_s of a level leans on it by 1/(1 + e) only:
        the part e/(1 + e) of its own variance is added, which is the curve's over the level's leverage.
        """
        random, count = np.random.default_rng(0), within.shape[2]
        sure = self.degrees if self.known else 0.0
        factor = sure / random.chisquare(sure, SESSION_DRAWS) if sure > 0 else np.ones(SESSION_DRAWS)
        own = np.full(count, repeats - 1)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # what nothing tells is infinite
            parts = (within + factor[:, None, None, None] * between) @ weigh_neighbours(own) / repeats
            usual = parts.sum(axis=3)
            degrees = np.nan_to_num((repeats - 1) * usual**2 / (parts**2).sum(axis=3), nan=1.0)
            seen = (parts * random.chisquare(own, (SESSION_DRAWS, len(within), 1, count)) / own).sum(axis=3)
            p = self.plant.model
            u = np.array(levels)
            form = nonlinear(u, self.share).Ts if p is not None and is_clutch(p) else None
            spare = count - form.size if form is not None else 0
            if p is not None and form is not None and spare >= LEVELS_TO_SPARE:
                D = form.rows(u) / p.steady(u)[:, None]
                excess = np.maximum(random.chisquare(spare, (SESSION_DRAWS, 1)) / spare - 1, 0.0)
                beyond = usual[:, 0] / np.diagonal(D @ np.linalg.pinv(D)) * excess / (1 + excess)
                degrees[:, 0] = satterthwaite((usual[:, 0], beyond), (degrees[:, 0], spare))
                seen[:, 0] += beyond
            worst = np.nan_to_num(t_quantile(degrees) * np.sqrt(seen), nan=np.inf).max(axis=2)
            quantiles = [np.quantile(each, share) for each, share in zip(worst.T, KEPT_SHARES, strict=False)]
        return dict(zip(self.numbers, percent(np.array(quantiles)).tolist(), strict=True))

    def drawn(self, n: int, seed: int) -> list[tuple[Specimen, Noise]]:
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
        return [(plant, scattered(self.noise, row)) for plant, row in zip(plants, factors, strict=True)]


def fitted_rig(fit: Fit) -> FittedRig:
    """The rig that a fit describes; `DataError` where it holds neither a nonlinear nor a friction model."""
    if fit.nonlinear is None and fit.plant_ is None and (fit.data.kind == "clutch" or not fit.friction_levels):
        raise DataError("the fit holds neither a nonlinear nor a friction model to plan with; fit again")
    plant = of_model(fit, fit.data.kind if fit.nonlinear is None and fit.plant_ is None else "clutch", "a fit")
    levels: Sequence[float] = plant.levels
    if plant.model is not None:
        refuse_unplanned(plant.model)
        levels, share = plant.model.u_range, plant.model.C
    else:
        share = (fit.friction.C if fit.friction is not None else None) or SHARE
    held = fit.uncertainty.noise if fit.uncertainty is not None else None
    noise = held if held is not None and set(PARAMETERS) <= set(held.scatter) else ASSUMED
    known = noise is held
    if known and fit.recorded is not None and fit.recorded.engagements < FEWEST_ENGAGEMENTS:
        noise = msgspec.structs.replace(noise, scatter=ASSUMED.scatter)
    return FittedRig(fit, plant, levels, share, noise, known)


def scattered(noise: Noise, factors: Array) -> Noise:
    """The same noise with other scatter of T_s, τ1, τ2, by factors of shape (3,)."""
    scatter = {name: noise.scatter[name] * float(factor) for name, factor in zip(PARAMETERS, factors, strict=True)}
    return msgspec.structs.replace(noise, scatter=scatter)


def _levels_drawn(plant: Specimen, rows: tuple[FrictionLevel, ...], random: np.random.Generator) -> Specimen:
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
