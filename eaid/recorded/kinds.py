"""Which kind of lag explains a log, by evidence: one lag, two in series or ringing, with a zero, each with a dead time.

Every kind has one gain and an idle output first; what enters linearly (gain, idle, start states) is solved for on a
grid of time constants, dampings and dead times (variable projection), and the best places are fitted to their end. Then
all get more of a gain: quadratic, cubic, one on each side of rest; and the best few time constants that go with the
input. What counts is

    score = squares (1 + 0.01 p') + 6 p s,    s = squares of the best over the number of independent samples

p unknowns, s what noise alone would save with one of them; p' those of gain and pace, and of the lags the part of what
is left that is no white noise, a dead time not among them. The clutch's own form, two lags in parallel over the input,
stands unless another kind scores less. An output whose rate follows the input is an integrator, and is refused by name.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from eaid.arrays import Array, scaled_inverse, white_squares
from eaid.estimate.forms import in_parallel, of_kind
from eaid.estimate.recorded_log import RecordedLog
from eaid.estimate.solver import ROUNDING, approach, newton_step
from eaid.levels.creep import SHARE_CHANCE
from eaid.plant.drive import Drive, beginning, delayed, fall_alone
from eaid.plant.forms import Form, Knots, LegendreForm, Proportional, Sides, knots_at
from eaid.plant.sums import lag_sums, swinging_sums
from eaid.recorded.few_rows import MOVING_ROWS, Copies
from eaid.recorded.from_logs import (
    COMPARED,
    GRID_ROWS,
    SEARCHED_ROWS,
    Setup,
    Solved,
    come_near,
    fit_near,
    setup_of,
    with_dead_time,
)

SHARED = [0, 4, 5]  # What `swinging_sums` have of all logs: the answer, its rate, and the output
GRID_TAUS, GRID_DAMPINGS, GRID_DELAYS = 14, (0.03, 0.2, 0.7, 1.3, 4.0), 18  # Of the grid
LONGEST_DEAD_TIME = 0.2  # Part of the longest log that a dead time may take
PER_UNKNOWN, PRICE = 0.01, 6.0  # Of the score
LAST_STEPS = 4
THROUGH_ALL = 0.9  # Part of the squares that a gain through every level may leave at most
# Part of the squares with one gain that a T_s(u) leaves, from which on kinds are begun behind that; inputs from which
# it goes through so many values where no cubic does, and the part of what is left that is white where one does
BENT_GAIN, MANY_INPUTS, BENT_KNOTS, BENT_WHITE = 0.5, 20, 13, 0.8
MOST_SPECTRUM_ROWS = 2**20  # Of a log, in which its frequencies are looked for
BEGUN_PLACES = 3  # Places of the grid from which each kind is fitted
FINALISTS = 2  # Kinds that are compared with rivals
PACES = (1, 2)  # Degrees of time constants over the input
SLOW_PART = 0.4  # Of the longest log, up to which a slow part beside a fast one is no drift
ENDLESS_TAU = 1e3  # Time constant of none, in records; of more the sums of two lags are all rounding
MOST_RECORDS = 20.0  # Of a lag's time constant, beyond which it is none
INTEGRATES = 1.03  # Squares of an integrator over those of the best kind, up to which that is what it is


@dataclass(frozen=True)
class LagKind:
    """A kind of lag: its name here, its law, whether z and θ are unknowns."""

    of: str
    law: str  # lag | swing; of rivals parallel | pair, too
    zero: bool = False
    late: bool = False

    @property
    def name(self) -> str:
        """Its name with its dead time."""
        return self.of + "+dead" * self.late


LAG_KINDS = tuple(
    LagKind(of, law, zero, late)
    for late in (False, True)
    for of, law, zero in (("lag", "lag", False), ("series", "swing", False), ("zero", "swing", True))
)


@dataclass(frozen=True, eq=False)
class Tried:
    """One kind fitted."""

    kind: LagKind
    solved: Solved
    score: float = math.inf
    within: float = 0.0  # Squares that the rows on which it was looked for do not show
    fast_alone: bool = False  # The clutch's form without its slow part

    @property
    def name(self) -> str:
        """Of the kind as it came out: ringing where ζ is below 1."""
        model = self.solved.setup.model
        if model.kind != "swing":
            return self.kind.name
        zeta = float(self.solved.coefficients[model.slices[2]][0])
        return self.kind.name.replace("series", "ringing" if zeta < 1 else "series")

    @property
    def paced(self) -> bool:
        """Whether lags of this kind go with the input; the clutch's do."""
        tau1 = self.solved.setup.model.slices[1]
        return self.kind.name != "clutch" and tau1.stop - tau1.start > 1

    @property
    def gains(self) -> int:
        """Coefficients of T_s(u)."""
        return int(self.solved.setup.model.slices[0].stop)

    @property
    def cost(self) -> float:
        """Sum of the squares that are left."""
        return self.solved.cost + self.within


@dataclass(frozen=True, eq=False)
class Search:
    """Logs, and what of them is looked at."""

    logs: tuple[RecordedLog, ...]
    low: float
    high: float
    dead_time_s: float | None = None  # Where it was given
    falls_as_left: bool = False  # As the clutch's form has it
    any_curve: bool = True  # T_s(u) may go through values: no form of it was asked for
    gain_of: Solved | None = None  # Whose T_s(u) stands for the input where the logs are looked at; None: one gain
    made: dict[float, tuple[Copies, ...]] = field(default_factory=dict)  # Copies of the logs, by the dead time behind

    def copies(self, dead_time_s: float) -> tuple[Copies, ...]:
        """The logs with their few rows behind a dead time, up to the next row, which many kinds share."""
        dead_time_s = math.ceil(dead_time_s / self.shortest_s) * self.shortest_s
        return self.made.setdefault(dead_time_s, tuple(Copies(log, dead_time_s) for log in self.logs))

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """The logs as they are looked at: where they are long by small copies."""
        found, bent = map(few_rows, self.copies(0.0)), self.gain_of
        return tuple(one if bent is None else one._replace(duty=bent.curves(one.duty).steady) for one in found)

    @cached_property
    def signed(self) -> bool:
        """Whether some input is below rest."""
        return any(float(log.input.min()) < 0 for log in self.logs)

    @cached_property
    def paces(self) -> tuple[int, ...]:
        """Degrees of time constants over the input that are tried: none where nothing tells them, as a single input, or
        falls alone, whose lags are those of where they lead."""
        return () if self.high <= self.low or fall_alone(self.drives) else PACES

    @property
    def shortest_s(self) -> float:
        """Usual time between two rows [s]."""
        return min(log.usual_s for log in self.logs)

    @property
    def longest_s(self) -> float:
        """Length of the longest log [s]."""
        return max(float(log.time_s[-1] - log.time_s[0]) for log in self.logs)

    def cost(self, theta: float, tau: float, zeta: float) -> float:
        """Squares left without a zero at a place of the grid."""
        return float(self.costs([delayed(drive, theta) for drive in self.drives], [(tau, zeta)])[0, 0])

    def costs(self, late: Sequence[Drive], shapes: Sequence[tuple[float, float]]) -> Array:
        """Squares left, all that is linear solved for, without and with a zero, (n, 2), of n pairs of τ and ζ; by
        series' law, one lag at ζ = ∞. `late` are the drives behind the dead time of the places."""
        one_lag = np.isinf([zeta for _, zeta in shapes])
        parts, total, found = np.zeros((len(shapes), 3, 3)), 0.0, np.empty((len(shapes), 2))
        for drive in late:
            sums = np.array([
                lag_sums(drive, np.array([tau]))[0] if single else swinging_sums(drive, drive.duty, tau, zeta)
                for (tau, zeta), single in zip(shapes, one_lag, strict=True)
            ])  # fmt: skip
            sums[one_lag, 3] = sums[one_lag, :, 3] = 0.0  # which has no second state
            own = 1 + np.flatnonzero([not drive.idle_known, not drive.starts_idle, not drive.starts_idle])
            # what a log has for itself goes first
            back = np.linalg.pinv(sums[:, own][:, :, own], hermitian=True, rcond=1e-12)
            cross = sums[:, SHARED][:, :, own]
            parts += sums[:, SHARED][:, :, SHARED] - cross @ back @ cross.swapaxes(1, 2)
            total += drive.left
        for column, shared in enumerate(([0], [0, 1])):
            b, among = parts[:, shared, 2], parts[:, shared][:, :, shared]
            back = np.linalg.pinv(among, hermitian=True, rcond=1e-12)
            found[:, column] = total + parts[:, 2, 2] - np.einsum("ki,kij,kj->k", b, back, b)
        return found

    def grid(self) -> list["GridPlace"]:
        """The squares left at every place of it."""
        taus = np.geomspace(0.6 * self.shortest_s, 2 * self.longest_s, GRID_TAUS).tolist()
        shapes = [(tau, zeta) for tau in taus for zeta in (math.inf, *GRID_DAMPINGS)]
        shapes += [(1 / w, zeta) for w in find_peak_frequencies(self) for zeta in GRID_DAMPINGS[:2]]
        thetas = [0.0, *self.delays] if self.dead_time_s is None else [self.dead_time_s]
        return [place for theta in thetas for place in self.places(theta, shapes)]

    @property
    def delays(self) -> list[float]:
        """Dead times of the grid [s]."""
        return [*np.geomspace(0.5 * self.shortest_s, LONGEST_DEAD_TIME * self.longest_s, GRID_DELAYS).tolist()]

    def places(self, theta: float, shapes: Sequence[tuple[float, float]]) -> list["GridPlace"]:
        """Places behind a dead time."""
        costs = self.costs([delayed(beginning(drive, GRID_ROWS), theta) for drive in self.drives], shapes).tolist()
        return [GridPlace(*shape, theta, (plain, zero)) for shape, (plain, zero) in zip(shapes, costs, strict=True)]

    def behind(self, plain: Solved, zero: bool) -> "GridPlace":
        """The best dead time beside the lags of a fit without one."""
        shape = (float(plain.coefficients[plain.setup.model.slices[1]][0]), math.inf)
        if plain.setup.model.kind == "swing":
            shape = shape[0], float(plain.coefficients[plain.setup.model.slices[2]][0])
        return min((self.places(theta, [shape])[0] for theta in self.delays), key=lambda one: one.costs[zero])


@dataclass(frozen=True)
class GridPlace:
    """A place of the grid."""

    tau: float  # Of a lag; of two 1/ω
    zeta: float  # ∞: one lag
    theta: float
    costs: tuple[float, float]  # Squares left without and with a zero


def find_best_places(search: Search, kind: LagKind, grid: Sequence[GridPlace]) -> list[GridPlace]:
    """The best places of the grid for a kind, from minima that differ by more than a factor."""
    given = search.dead_time_s is not None
    of_law = [one for one in grid if math.isinf(one.zeta) == (kind.law == "lag")]
    rows = [one for one in of_law if given or (one.theta > 0) == kind.late]
    best: list[GridPlace] = []
    for place in sorted(rows, key=lambda one: one.costs[kind.zero]):
        if all(abs(math.log(place.tau / one.tau)) > 0.7 for one in best):
            best.append(place)
        if len(best) == BEGUN_PLACES:
            break
    return best


def find_peak_frequencies(search: Search) -> list[float]:
    """Frequencies at which the outputs have most, 0 left out [rad/s]."""
    log = max(search.logs, key=lambda one: len(one.time_s))
    y, dt_s = np.nan_to_num(log.output[:MOST_SPECTRUM_ROWS] - np.nanmean(log.output)), log.usual_s
    power = np.abs(np.fft.rfft(np.diff(y))) ** 2
    top = np.argsort(power[1:])[-2:] + 1
    return [float(2 * np.pi * k / ((len(y) - 1) * dt_s)) for k in top]


def fit_kind_from(search: Search, kind: LagKind, gain: Form, begin: GridPlace | Solved, pace: int = 0) -> Solved:
    """A kind fitted from a place of the grid, or with more of a gain or pace from where it ended with less."""
    model = of_kind(
        kind.law, gain, search.low, search.high, search.shortest_s, None if kind.zero else 0.0, search.signed, pace
    )
    theta = begin.theta if isinstance(begin, GridPlace) else begin.dead_time_s
    setup = setup_of(model, search.copies(theta), True, theta)
    few = tuple(map(few_rows, setup.copies))
    setup = replace(setup, drives=few, copies=(), falls_as_left=search.falls_as_left)
    if isinstance(begin, GridPlace):
        x = np.zeros(setup.size)
        x[model.slices[1]] = begin.tau
        x[model.slices[2]] = min(max(begin.zeta, 0.02), 20.0)
    else:
        x = carry_unknowns(begin, setup, gain)
    if kind.late:
        setup, x = with_dead_time(setup, x, theta)
    return come_near(setup, solve_gain(setup, x))


def carry_unknowns(near: Solved, setup: Setup, gain: Form) -> Array:
    """Unknowns of a richer gain or pace from those of a simpler one, without the dead time."""
    before, model = near.fitted, setup.model
    values = before.model.rows(gain.inputs)[0] @ near.x[: before.model.size]
    x = np.zeros(setup.size)
    x[model.slices[0]] = np.linalg.lstsq(gain.rows(gain.inputs), values, rcond=None)[0]
    one, fewer = model.slices[1], before.model.slices[1]
    x[one][: fewer.stop - fewer.start] = near.x[fewer]
    x[one.stop : model.size] = near.x[fewer.stop : before.model.size]
    x[setup.shared :] = near.x[before.shared :]
    return x


def solve_gain(setup: Setup, x: Array) -> Array:
    """The unknowns with all that enters linearly at its least squares: the gain, idle outputs, start states."""
    free = [*range(setup.model.slices[0].stop), *range(setup.shared, setup.size)]
    x = x.copy()
    x[free] = 0.0
    _, gradient, curvature = setup.together(x)
    x[free] = -scaled_inverse(curvature[np.ix_(free, free)], 1e-12) @ gradient[free]
    return x


def richer_gains(search: Search, stepwise_levels: int) -> Iterator[Form]:
    """Gains beyond one for all inputs, of no more coefficients than the inputs tell apart; through rest where none of
    the logs shows it, for a constant would be the idle output's."""
    low, high = search.low, search.high
    if search.signed:
        yield Sides(Proportional(low, high), Proportional(low, high))
    rests = any(log.starts_idle or log.baseline is not None or bool((log.input == 0).any()) for log in search.logs)
    for degree in (2, 3) if stepwise_levels != 2 else (1,):
        if not search.signed and stepwise_levels > degree:
            yield LegendreForm(degree, low, high) if rests else Proportional(low, high, degree)


def noise_saves(solved: Solved, unknowns: int, chance: float = SHARE_CHANCE) -> float:
    """Squares that so many unknowns save of nothing but noise, more as rarely as by `chance`."""
    return float(chdtri(unknowns, chance)) * solved.cost / solved.independent


def refit_on_all(search: Search, one: Tried, last: bool = False) -> Tried:
    """The same fitted to every sample, as rivals are already; near enough to be compared, or to its very end."""
    if one.fast_alone or one.kind not in LAG_KINDS:
        return one
    solved, model = one.solved, one.solved.setup.model
    theta = solved.setup.dead_time(solved.x)
    setup = setup_of(model, search.copies(theta), True, theta, search.falls_as_left, solved.setup.extras)
    if not last:
        end = approach(setup.problem(), solved.x, near=COMPARED)
        return replace(one, solved=replace(solved, fitted=setup, x=end.x, cost=end.cost), within=0.0)
    ended = fit_near(setup, solved.x)
    problem = setup.every.problem()
    if ended.cost <= 1e3 * problem.floor:  # no noise: steps too small to be seen in the cost go to the last digits
        x = ended.x
        for _ in range(LAST_STEPS):
            x = x + newton_step(problem, x, *problem.normal(x)[1:]).d
        ended = replace(ended, x=x, cost=problem.value(x)[0])
    return replace(one, solved=ended, within=0.0)


def score_kinds(tried: Sequence[Tried]) -> list[Tried]:
    """With their scores, the least first: unknowns have a price in what one saves of nothing but noise, and in parts of
    what is left: those of gain and pace, which differ from run to run, in full, those of the lags as far as that is no
    white noise; a dead time, which a loop feels most, has none of these. Noise is what constant lags leave."""
    least = min((one for one in tried if not one.paced), key=lambda one: one.cost)
    rounding, independent = least.solved.setup.problem().floor / ROUNDING * 1e-13, least.solved.independent
    noise, coloured = least.cost / independent, 1 - min(independent / sum(map(len, least.solved.outputs)), 1.0)
    rows = []
    for one in tried:
        p, of_curves = one.solved.setup.size, one.solved.setup.model.slices[1].stop - 1
        part = PER_UNKNOWN * (of_curves + coloured * (p - of_curves - ("dead" in one.solved.fitted.extras)))
        rows.append(replace(one, score=(one.cost + rounding) * (1 + part) + PRICE * p * noise))
    return sorted(rows, key=lambda one: one.score)


def try_every_kind(search: Search, levels: int, rivals: Sequence[Tried]) -> list[Tried]:
    """Every kind fitted, beside `rivals`, the best first; the best few with more of a gain.

    The best stand fitted to every sample, as rivals do; the others to the rows on which they are looked for.
    """
    gain, grid, tried = Proportional(search.low, search.high), search.grid(), list[Tried]()
    for kind in LAG_KINDS:
        if kind.late and search.dead_time_s is not None:
            continue
        begins = find_best_places(search, kind, grid)
        if kind.late:
            begins += [search.behind(one.solved, kind.zero) for one in tried if one.kind == replace(kind, late=False)]
        ends = [fit_kind_from(search, kind, gain, at) for at in begins]
        tried.append(Tried(kind, min(ends, key=lambda one: one.cost)))
    forms = list(richer_gains(search, levels))
    for one in tuple(tried):  # what a gain lacks another lag or a dead time imitates: none is left out for its cost
        more = [(form, fit_kind_from(search, one.kind, form, one.solved)) for form in forms]
        # one through all levels takes what their rests are off for a curve
        tried += [
            Tried(one.kind, end) for form, end in more if form.size < levels or end.cost <= THROUGH_ALL * one.cost
        ]
    tried += try_bent_gains(search, tried, levels)
    tried = [one for one in tried if shows_its_lags(one, search)] or tried
    worst_first = sorted(tried, key=lambda one: -one.cost)
    tried = list({(one.kind, one.gains): one for one in worst_first}.values())  # the best of what began in two places
    rows = score_kinds([*tried, *try_paced_lags(search, score_kinds(tried), levels)])
    ended = [refit_on_all(search, one) for one in rows[:FINALISTS]]
    within = max(ended[0].cost - rows[0].cost, 0.0)
    ended += [*(replace(one, within=within) for one in rows[FINALISTS:]), *rivals]
    best, *others = score_kinds(ended)
    return [refit_on_all(search, best, last=True), *others]


def try_bent_gains(search: Search, tried: Sequence[Tried], levels: int) -> list[Tried]:
    """Kinds begun behind the T_s(u) of the best single lag, where one gain for all inputs explains far less: begun
    with one gain their lags imitate what it lacks; of many inputs through values where no cubic does."""
    lags = [one for one in tried if one.kind.law == "lag"]
    best, plain = (min(of, key=lambda one: one.cost) for of in (lags, [one for one in lags if one.gains == 1]))
    knots, found = knots_of(search) if search.any_curve and levels >= MANY_INPUTS else None, list[Tried]()
    if knots is not None and is_bent(best):
        through = Tried(best.kind, fit_kind_from(search, best.kind, knots, best.solved))
        if through.cost < THROUGH_ALL * best.cost:
            best, found = through, [through]
    form = best.solved.setup.model.Ts
    if best.cost > BENT_GAIN * plain.cost or form is None:
        return found
    bent = replace(search, gain_of=best.solved)
    grid = bent.grid()
    for kind in (one for one in LAG_KINDS if one.law != "lag"):
        begins = [] if kind.late and search.dead_time_s is not None else find_best_places(bent, kind, grid)
        ends = [fit_kind_from(search, kind, form, at) for at in begins]
        found += [Tried(kind, min(ends, key=lambda one: one.cost))] if ends else []
    return found


def is_bent(one: Tried) -> bool:
    """Whether much of what a kind leaves is no white noise."""
    left = [one.solved.missed_of(k) for k in range(len(one.solved.setup.drives))]
    return sum(map(white_squares, left)) < BENT_WHITE * sum(float(r @ r) for r in left)


def knots_of(search: Search) -> Knots | None:
    """T_s(u) through values at some of the inputs that the logs show; None of one of both signs, or of a narrow
    range."""
    shown = np.concatenate([one.duty[one.which] for one in map(few_rows, search.copies(0.0))])
    shown = shown[(shown > 0) & (shown >= search.low) & (shown <= search.high)]
    if search.signed or not search.low < search.high or len(shown) < BENT_KNOTS:
        return None
    return Knots(knots_at(shown, search.low, search.high, BENT_KNOTS))


def try_paced_lags(search: Search, rows: Sequence[Tried], levels: int) -> list[Tried]:
    """The best kinds, each with every gain that was tried, with time constants that go with the input."""
    found: list[Tried] = []
    for kind in list(dict.fromkeys(one.kind for one in rows))[:FINALISTS]:
        near = [one.solved for one in rows if one.kind == kind]
        for pace in search.paces:
            if levels > pace:
                gains = ((one, one.setup.model.Ts) for one in near)
                ends = [fit_kind_from(search, kind, gain, one, pace) for one, gain in gains if gain is not None]
                near = [min(ends, key=lambda one: one.cost)]
                found += [Tried(kind, one) for one in ends]
    return [one for one in found if shows_its_lags(one, search)]


def shows_its_lags(one: Tried, search: Search) -> bool:
    """Whether the logs show both lags: one under half a sample imitates what happens between samples, one that outlasts
    the logs a drift; and a dead time, where the kind has one."""
    model, x = one.solved.setup.model, one.solved.coefficients
    if one.kind.late and one.solved.dead_time_s <= 1e-6 * search.shortest_s:
        return False
    if model.kind != "swing":
        return True
    tau, zeta = (float(x[part][0]) for part in model.slices[1:])
    apart = zeta + math.sqrt(max(zeta**2 - 1, 0.0)) if zeta > 1 else 1.0
    rises = one.kind.zero and zeta > 1 and 0 < in_parallel(zeta, float(x[-1]))[2] < 1  # as a drift does
    longest_s = search.longest_s * (SLOW_PART if rises else 1.0)
    return tau / apart >= 0.5 * search.shortest_s and tau * apart <= longest_s


def integrates(search: Search, best: Tried) -> bool:
    """Whether the output's rate follows the input: its slowest lag outlasts the logs, and none at all explains them; or
    lasts as none does, with a gain on each side of rest, as friction leaves one."""
    plant = best.solved.setup.model.parameters(best.solved.coefficients)
    records = plant.slowest_s(search.high) / search.longest_s
    if records < 1:
        return False
    if isinstance(best.solved.setup.model.Ts, Sides) and records > MOST_RECORDS:
        return True
    endless = ENDLESS_TAU * search.longest_s
    theta = best.solved.dead_time_s
    fast = np.geomspace(0.6 * search.shortest_s, search.longest_s, GRID_TAUS)
    costs = [search.cost(theta, endless, math.inf)]
    costs += [  # τ1 and an endless τ2: 1/ω = √(τ1 τ2), ζ = (τ1 + τ2)/(2 √(τ1 τ2))
        search.cost(theta, math.sqrt(tau * endless), (tau + endless) / (2 * math.sqrt(tau * endless)))
        for tau in fast.tolist()
    ]
    return min(costs) <= INTEGRATES * best.cost


def few_rows(log: Copies) -> Drive:
    """Every row of a log that is not long, else a few that cost what it costs, of its begin where these are many."""
    return beginning(log.log.drive if len(log.log.time_s) <= MOVING_ROWS else log.small, SEARCHED_ROWS)
