"""Fits to recorded logs, from starts to the least cost: compared on a coarse copy, ended on every sample.

SLSQP works on whitened unknowns, a Gauss–Newton matrix at each round; the end is polished by constrained Newton steps
on every sample, and what one more of them would gain is the verdict, as with the step fits.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, median
from eaid.estimate.forms import LEAST_TAU_S, Constraints, Model, Rows
from eaid.estimate.recorded_log import RecordedLog, creep_at
from eaid.estimate.solver import (
    CONVERGED,
    ROUNDING,
    SOLVE_SETTLED,
    EndPoint,
    Problem,
    approach,
    bring_in,
    draw_in,
    polish,
    slsqp,
    solve_ends,
    solver_verdict,
    with_second_derivatives,
)
from eaid.estimate.starts import MOST_STARTS, START_SHARES, time_constants
from eaid.levels.from_steps import CHI2_APART
from eaid.plant.derivatives import at_first, derivatives, swinging
from eaid.plant.drive import AT_CREEP, AT_IDLE, Drive, Tables, beginning, delayed
from eaid.plant.dynamics import TAU_FLOOR_S, Plant
from eaid.plant.forms import Form, LegendreForm, PerLevel
from eaid.plant.sums import linear_sums
from eaid.recorded.few_rows import Copies
from eaid.results.common import Solver
from eaid.steps.noise import effective_samples

NO_ROW = 1e-6  # Part of a row below which a dead time is none
# Of a log, from its first on, by which places of a grid are compared, and by which ends of starts, and kinds, are
GRID_ROWS, SEARCHED_ROWS = 8_000, 60_000
ROWS_AT_ONCE = 30_000  # Of a log whose derivatives are worked out: they stay near the processor
# What a model can have besides its coefficients, with the values that do nothing
NO_EXTRAS = {"rest": (0.0, 0.0), "fall": (1.0, 1.0), "excess": (0.0,), "dead": (0.0,)}
# Their constraints a'x ≥ b: code, a, b
EXTRA_LIMITS: dict[str, tuple[tuple[str, tuple[float, ...], float], ...]] = {
    "rest": (("release-tau1-floor", (1.0, 0.0), TAU_FLOOR_S), ("release-tau2-meets-tau1", (-1.0, 1.0), 0.0)),
    "fall": (
        ("fall-tau1-least", (1.0, 0.0), 0.02),
        ("fall-tau2-least", (0.0, 1.0), 0.02),
        ("fall-tau1-most", (-1.0, 0.0), -50.0),
        ("fall-tau2-most", (0.0, -1.0), -50.0),
    ),
    "excess": (("hysteresis-least", (1.0,), -0.8),),
    "dead": (("dead-time-none", (1.0,), 0.0),),
}


@dataclass(frozen=True, eq=False)
class UnknownsOfLog:
    """Where the unknowns of a log lie, beside the coefficients of T_s, τ1 and τ2."""

    # In x: C, the extras, idle output, x1 and x2 at its first row, both of a creep; −1 where one is no unknown, (12,)
    x: NDArray[np.intp]
    shared: int  # Unknowns that all logs share, the first ones

    @cached_property
    def columns(self) -> NDArray[np.intp]:
        """Places in x of all unknowns that it knows, in the kernel's order."""
        return np.append(np.arange(self.shared), self.own[self.own >= 0])

    @cached_property
    def kernel(self) -> NDArray[np.intp]:
        """As `x`, among these columns."""
        return np.where(self.x >= 0, np.searchsorted(self.columns, self.x), -1)

    @property
    def own(self) -> NDArray[np.intp]:
        """Idle output, start states, and how a creep goes in x, (5,)."""
        return self.x[AT_IDLE:]


@dataclass(frozen=True, eq=False)
class Setup:
    """Logs and a model: everything but the unknowns."""

    model: Model
    drives: tuple[Drive, ...]  # The logs in numbers
    extras: tuple[str, ...] = ()
    idle_free: bool = True  # Whether idle outputs that are not known are unknowns; else they are 0
    copies: tuple[Copies, ...] = ()  # Where `drives` are but copies in fewer rows: the logs themselves
    longest_s: float = 0.0  # Length of the longest log [s]
    shortest_s: float = 0.0  # Usual time between two rows [s]
    longest_hold_s: float = 0.0  # Longest time for which an input is held, or a moving one is recorded [s]
    dead_time_s: float = 0.0  # θ where it is no unknown [s]
    creeping: int = 0  # So many logs, the first ones, have an output that creeps beside its response
    falls_as_left: bool = False  # Whether falls to rest go with the time constants of the input that was left

    @cached_property
    def limits(self) -> Constraints:
        """Constraints of the model."""
        return self.model.limits(self.longest_s, self.shortest_s)

    def slopes(self, duty: Array) -> Array:
        """Derivatives of T_s, τ1, τ2 at some inputs by all unknowns, (3, L, n)."""
        rows = self.model.rows(duty)[:3]
        return np.pad(rows, ((0, 0), (0, 0), (0, self.size - rows.shape[2])))

    @cached_property
    def every(self) -> "Setup":
        """The same on every sample."""
        return replace(self, drives=tuple(one.log.drive for one in self.copies)) if self.copies else self

    @cached_property
    def over(self) -> tuple[Array, ...]:
        """The share of each log that is over at its rows that count, (N,)."""
        found = []
        for drive in self.drives:
            t_s = np.cumsum(drive.dt_s)
            found.append((t_s - drive.dt_s)[drive.w > 0] / t_s[-1])
        return tuple(found)

    @cached_property
    def maps(self) -> tuple[Rows, ...]:
        """What the model makes of each log's inputs."""
        return tuple(self.model.rows_of(one.duty, one.paces if self.falls_as_left else None) for one in self.drives)

    @cached_property
    def shared(self) -> int:
        """Unknowns that all logs share."""
        return self.model.size + sum(len(NO_EXTRAS[name]) for name in self.extras)

    @cached_property
    def places(self) -> tuple[UnknownsOfLog, ...]:
        """Where the unknowns of each log lie."""
        shared = [self.model.size - 1 if self.model.share is None else -1]
        for name, none in NO_EXTRAS.items():
            at = self.at(name)
            shared += [at + k if at >= 0 else -1 for k in range(len(none))]
        found, before = [], self.shared
        for k, drive in enumerate(self.drives):
            loaded, creeps = not drive.starts_idle, k < self.creeping
            of_two = loaded and self.model.tau2 is not None
            free = np.array([self.idle_free and not drive.idle_known, loaded, of_two, creeps, creeps])
            own = np.where(free, before + np.cumsum(free) - 1, -1)
            found.append(UnknownsOfLog(np.append(shared, own), self.shared))
            before += int(free.sum())
        return tuple(found)

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return self.shared + sum(len(place.columns) - self.shared for place in self.places)

    def at(self, name: str) -> int:
        """First place of an extra in x; −1 where it is no unknown."""
        if name not in self.extras:
            return -1
        before = self.extras[: self.extras.index(name)]
        return self.model.size + sum(len(NO_EXTRAS[one]) for one in before)

    def tables(self, x: Array, log: int) -> tuple[Tables, Array]:
        """T_s, τ1, τ2 of a log's inputs, and the numbers beside them."""
        at, given = self.places[log].x, (self.model.share or 0.0, *itertools.chain(*NO_EXTRAS.values()), *np.zeros(5))
        return self.model.tables(self.maps[log], x), np.where(at >= 0, x[at], given)

    @property
    def between_rows(self) -> bool:
        """Whether some input was noted late by a part of a row: θ then is what that part is off."""
        return any(drive.late_s for drive in self.drives)

    def dead_time(self, x: Array) -> float:
        """θ [s]; none where it is next to no part of a row."""
        at = self.at("dead")
        if at < 0:
            return self.dead_time_s
        return float(x[at]) if abs(x[at]) > NO_ROW * self.drives[0].dt_s[0] else 0.0

    def dead_time_of_plant(self, x: Array) -> float:
        """The same as far as it is the plant's."""
        return 0.0 if self.between_rows else self.dead_time(x)

    def acting(self, log: int, theta_s: float) -> Drive:
        """A log's inputs where they act; of few rows made once for all places with one dead time."""
        few = len(self.drives[log].w) <= SEARCHED_ROWS
        return self.few_behind(log, theta_s) if few else delayed(self.drives[log], theta_s)

    @cached_property
    def few_behind(self) -> Callable[[int, float], Drive]:
        """The same as kept, of the places that were asked for last, for as long as this setup is."""
        drives = self.drives
        return lru_cache(maxsize=32)(lambda log, theta_s: delayed(drives[log], theta_s))

    def derivatives(self, x: Array, log: int, of_unknowns: bool = True, rows: int = ROWS_AT_ONCE) -> Iterator[Array]:
        """√w ∂f/∂x of a log's own columns, then √w (f − y), for its samples that count, (N, p + 1), some rows at a
        time; where it is not `of_unknowns`, the residuals alone, (N, 1)."""
        place, drive = self.places[log], self.acting(log, self.dead_time(x))
        (tables, scalars), kernel, count = self.tables(x, log), place.kernel[:AT_CREEP], len(place.columns)
        if not of_unknowns:
            none = np.zeros((len(drive.duty), 0))
            tables, kernel, count = tables._replace(by_steady=none, by_tau1=none, by_tau2=none), np.full(10, -1), 0
        law = swinging if self.model.kind == "swing" else derivatives
        state, at = at_first(scalars[:AT_CREEP], kernel, count), 0
        for first in range(0, len(drive.w), rows):
            end = min(first + rows, len(drive.w))
            found = np.asarray(law(drive, tables, scalars, kernel, state, first, end))
            if (creep := place.kernel[AT_CREEP]) >= 0:
                w = drive.w[first:end]
                crept = np.sqrt(w[w > 0])[:, None] * creep_at(self.over[log][at : at + len(found)])
                found[:, -1] += crept @ scalars[AT_CREEP:]
                if of_unknowns:
                    found[:, creep : creep + 2] = crept
            at += len(found)
            yield found

    def residuals(self, x: Array, log: int) -> Array:
        """√w (f − y) of the samples of a log that count, (N,)."""
        return np.concatenate([*self.derivatives(x, log, of_unknowns=False)])[:, 0]

    def jacobian(self, x: Array, log: int) -> tuple[Array, Array]:
        """√w ∂f/∂x of a log's own columns, (N, p), and √w (f − y), (N,)."""
        found = np.concatenate([*self.derivatives(x, log)])
        return found[:, :-1], found[:, -1]

    def together(self, x: Array) -> tuple[float, Array, Array]:
        """Cost, gradient and Gauss–Newton matrix."""
        cost, gradient, curvature = 0.0, np.zeros(self.size), np.zeros((self.size, self.size))
        for log, drive in enumerate(self.drives):
            at = self.places[log].columns
            P = 2.0 * np.sum([found.T @ found for found in self.derivatives(x, log)], axis=0)
            cost += 0.5 * float(P[-1, -1]) + drive.left
            gradient[at] += P[-1, :-1]
            curvature[np.ix_(at, at)] += P[:-1, :-1]
        return cost, gradient, curvature

    def problem(self) -> Problem:
        """For the solver: constraints of the model, and of the extras."""
        limits, more = self.limits, [(self.at(name), *one) for name in self.extras for one in EXTRA_LIMITS[name]]
        A = np.zeros((len(limits.A) + len(more), self.size))
        A[: len(limits.A), : self.model.size] = limits.A
        for row, (at, _, along, _) in zip(A[len(limits.A) :], more, strict=True):
            row[at : at + len(along)] = along
        b = np.append(limits.b, [least for *_, least in more])
        if self.between_rows and (at := self.at("dead")) >= 0:
            b[A[:, at] != 0] -= self.shortest_s
        codes = (*limits.codes, *(code for _, code, _, _ in more))
        energy = 0.0  # weighted sum of the squared outputs about each log's mean
        for drive in self.drives:
            mean = float(drive.w @ drive.y) / float(drive.w.sum())
            energy += float(drive.w @ (drive.y - mean) ** 2) + drive.left
        return Problem(self.together, A, b, codes.__getitem__, floor=ROUNDING * energy)


def setup_of(
    model: Model, logs: Sequence[RecordedLog | Copies], idle_free: bool = True, dead_time_s: float = 0.0,
    falls_as_left: bool = False, extras: tuple[str, ...] = (), creeping: int = 0,
) -> Setup:  # fmt: skip
    """Logs and a model behind a dead time, with the copies on which its fit is looked for, where they are not there;
    what rings is no polynomial on the blocks of the few rows."""
    copies = tuple(one if isinstance(one, Copies) else Copies(one, dead_time_s) for one in logs)
    all_logs = [one.log for one in copies]
    longest = max(float(log.time_s[-1] - log.time_s[0]) for log in all_logs)
    shortest = median([log.usual_s for log in all_logs])
    holds = [
        np.diff(log.time_s[np.append(log.changes, -1)]).max() if log.stepwise else log.time_s[-1] for log in all_logs
    ]
    hold = float(max(holds))
    rows = tuple(one.log.drive if model.kind == "swing" else one.small for one in copies)
    return Setup(
        model, rows, extras, idle_free, copies, longest, shortest, hold, dead_time_s, creeping, falls_as_left
    )  # fmt: skip


def with_dead_time(setup: Setup, x: Array, theta_s: float) -> tuple[Setup, Array]:
    """The same with the dead time as an unknown, and the unknowns with its value."""
    return replace(setup, extras=(*setup.extras, "dead")), np.insert(x, setup.shared, theta_s)


def linear_parts(setup: Setup, shapes: Sequence[Array] | Array) -> tuple[Array, Array]:
    """Costs (K,) of some x, (K, n), and places (K, n) with what enters linearly solved for."""
    model, x = setup.model, np.array(shapes)
    a, one, two = model.slices[0].stop, *model.slices[1:]
    owns = [place.own[:3] for place in setup.places]  # a creep is no part of a start
    own = np.concatenate([one[one >= 0] for one in owns]).astype(np.intp)
    free = np.concatenate([np.arange(a), own]).astype(np.intp)
    share = x[:, model.size - 1] if model.share is None else np.full(len(x), model.share)
    size = len(free)
    sums = np.zeros((len(x), size + 1, size + 1))
    for every, rows, its in zip(setup.drives, setup.maps, owns, strict=True):
        drive = delayed(every, setup.dead_time_s)
        tau1 = np.maximum(x[:, one] @ rows.tau1.T, LEAST_TAU_S)
        tau2 = np.maximum(x[:, two] @ rows.tau2.T, LEAST_TAU_S) if model.tau2 else np.ones_like(tau1)
        found = linear_sums(drive, rows.steady, tau1, tau2, share)
        known = np.concatenate([np.arange(a), np.where(its >= 0, np.searchsorted(free, its), -1), [size]])
        at = np.flatnonzero(known >= 0)
        sums[:, known[at][:, None], known[at]] += found[:, at[:, None], at]
    scale = np.sqrt(np.maximum(np.diagonal(sums, axis1=1, axis2=2)[:, :size], 1e-300))
    A = sums[:, :size, :size] / (scale[:, :, None] * scale[:, None, :])
    v = sums[:, :size, size] / scale
    z = np.linalg.solve(A + 1e-10 * np.eye(size), v[:, :, None])[:, :, 0]
    x[:, free] = z / scale
    return sums[:, size, size] + np.einsum("kij,ki,kj->k", A, z, z) - 2 * (v * z).sum(axis=1), x


TAUS_TRIED = 17  # Values of τ on the grid, from half a sample to the longest log
VALUES_TRIED = 3  # Values tried at each input


def starts(setup: Setup, problem: Problem) -> list[Array]:
    """Feasible starts, the most promising first, and a plain one with constant τ last."""
    model = setup.model
    dt_s = np.concatenate([drive.dt_s[drive.dt_s > 0] for drive in setup.drives])
    grid = np.geomspace(max(0.5 * median(dt_s), 2 * TAU_FLOOR_S), setup.longest_s, TAUS_TRIED)
    turns = [_turn(form) for form in (model.tau1, model.tau2) if form is not None]
    M, found = model.rows(model.limited), []
    some = replace(setup, drives=tuple(beginning(drive, GRID_ROWS) for drive in setup.drives))
    for share in START_SHARES if model.share is None else (model.share,):

        def placed(*values: Array, share: float = share) -> Array:
            """x of N values of τ1 and τ2 each, (N, n)."""
            x = np.zeros((len(values[0]), setup.size))
            for part, turn, tau in zip(model.slices[1:], turns, values, strict=False):
                x[:, part] = tau @ turn.T
            if model.share is None:
                x[:, model.size - 1] = share
            return x

        def gain(*values: Array) -> Array:
            x = placed(*values)
            tau1, tau2 = (x[:, : model.size] @ row.T for row in M[1:3])
            sound = (tau1 >= TAU_FLOOR_S).all(axis=1) & ((tau2 >= tau1).all(axis=1) | (model.tau2 is None))
            return np.where(sound, -linear_parts(some, x)[0], -np.inf)

        if model.tau2 is None:
            found += [placed(grid[[k], None])[0] for k in np.argsort(-gain(grid[:, None]))[:MOST_STARTS]]
            continue
        i, j = np.triu_indices(TAUS_TRIED, 1)
        pairs = np.full((TAUS_TRIED, TAUS_TRIED), -np.inf)
        pairs[i, j] = gain(*(np.tile(grid[at, None], turn.shape[1]) for at, turn in zip((i, j), turns, strict=True)))
        sizes = turns[0].shape[1], turns[1].shape[1]
        found += [placed(one[None], two[None])[0] for one, two in
                  time_constants(gain, pairs, grid, sizes, setup.longest_hold_s, VALUES_TRIED)]  # fmt: skip
    cost, places = linear_parts(setup, np.array(found))
    order = np.argsort(cost)
    flat = inner(setup, places[order[0]], problem)
    return [bring_in(places[k], flat, problem) for k in order[:MOST_STARTS]] + [flat]


def _turn(form: Form) -> Array:
    """Coefficients of a form by its values at as many inputs; those of levels by one value for all."""
    many = isinstance(form, LegendreForm)
    return np.asarray(np.linalg.inv(form.rows(form.inputs)) if many else np.ones((form.size, 1)))


def inner(setup: Setup, x: Array, problem: Problem) -> Array:
    """A feasible point with constant τ near `x`: T_s is drawn to its mean where it falls below 0."""
    model, flat = setup.model, x.copy()
    least = 2 * TAU_FLOOR_S
    for form, part in zip((model.tau1, model.tau2), model.slices[1:], strict=True):
        if form is not None:
            size = max(float((form.rows(model.limited) @ x[part]).mean()), least)
            flat[part] = _turn(form) @ np.full(_turn(form).shape[1], size)
            least = 1.5 * size
    calm, part = flat.copy(), model.slices[0]
    if model.Ts is not None and model.tau2 is not None:
        size = max(float((model.Ts.rows(model.limited) @ x[part]).mean()), 1e-12)
        calm[part] = _turn(model.Ts) @ np.full(_turn(model.Ts).shape[1], size)
    return draw_in(flat, calm, problem)


# A constraint a'x ≥ b holds a fit that ends within this part of b: where no cost tells, a solver stops short
AT_BOUND = 1e-6
RIVAL_COST = 0.05  # An end this part of the cost above the best is no rival
COMPARED = 1e-6  # Part of the cost that a further step would gain, at which fits are compared
AT_BEND = 1e-6  # Part of the cost by which holding a dead time may raise it
# Newton steps along a bent valley, where τ1 and τ2 all but meet; of inputs that move every row, where each takes long
LONG_WAY, LONG_WAY_MOVING = 1000, 20


@dataclass(frozen=True, eq=False)
class Solved:
    """Where a fit ended."""

    fitted: Setup  # With the copies on which it was looked for
    x: Array
    cost: float
    solver: Solver
    # Inputs without the noise of the outputs, where they stood in for the recorded ones in the derivatives
    instruments: tuple[Drive, ...] | None = None
    # Where the engagements of its logs have gains of their own: the fit to logs without these, with the same unknowns
    beside: "Solved | None" = None
    levels_each: bool = False  # Whether its lags are those of levels with a gain each, its gain that behind these

    @property
    def setup(self) -> Setup:
        """On every sample."""
        return self.fitted.every

    @cached_property
    def outputs(self) -> tuple[Array, ...]:
        """What was recorded in the rows that are compared, less a known baseline, of each log."""
        return tuple(one.y if one.w.all() else one.y[one.w > 0] for one in self.setup.drives)

    @cached_property
    def missed(self) -> tuple[Array, ...]:
        """Model less recorded in those rows."""
        return tuple(map(self.missed_of, range(len(self.setup.drives))))

    def missed_of(self, log: int) -> Array:
        """The same of one log."""
        w, r = self.setup.drives[log].w, self.setup.residuals(self.x, log)
        r /= np.sqrt(w if len(w) == len(r) else w[w > 0])
        return r

    @property
    def logs(self) -> list[RecordedLog]:
        """What was fitted."""
        return [one.log for one in self.fitted.copies]

    @cached_property
    def independent(self) -> float:
        """How many samples of what it leaves are worth one each."""
        count = 0.0
        for k, drive in enumerate(self.setup.drives):
            r = self.missed_of(k)  # not kept, as many fits are compared
            count += effective_samples(r, float(drive.dt_s.sum()) / max(len(r), 1))
        return max(count, 1.0)

    @property
    def coefficients(self) -> Array:
        """Of the model alone."""
        return self.x[: self.setup.model.size]

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Constraints that hold it, those of the model first."""
        problem = self.setup.problem()
        return np.flatnonzero(problem.A @ self.x - problem.b < 1e-9 + AT_BOUND * np.abs(problem.b))

    @property
    def dead_time_s(self) -> float:
        """θ [s]."""
        return self.fitted.dead_time(self.x)

    def curves(self, duty: Array) -> Tables:
        """T_s, τ1 and τ2 at some inputs."""
        return self.setup.model.tables(self.setup.model.rows_of(duty), self.coefficients)


def fit_setup(setup: Setup) -> Solved:
    """The least-squares unknowns, from our own starts."""
    some = replace(setup, drives=tuple(beginning(drive, SEARCHED_ROWS) for drive in setup.drives))
    near = some.problem()
    ends = sorted((approach(near, x) for x in starts(some, near)), key=lambda end: end.cost)
    reach = RIVAL_COST if all(one.log.stepwise for one in setup.copies) else np.inf  # averages have errors of their own
    rivals = [end for end in ends if end.cost <= (1 + reach) * ends[0].cost + near.floor]
    kept = {f"{end.cost:.5g}": end.x for end in reversed(rivals)}  # one of each cost
    return finish(setup, [*kept.values()], sum(end.evaluations for end in ends), [end.cost for end in ends])


def finish(setup: Setup, begin: Sequence[Array], tried: int = 0, costs: Sequence[float] = ()) -> Solved:
    """From near ends to the verdict: solved on the small copy, confirmed, or taken to its end, on every sample."""
    near, held = setup.problem(), all(one.log.stepwise for one in setup.copies)
    ends = [approach(near, x) for x in begin]
    if min(end.cost for end in ends) > near.floor:  # beneath it lies rounding, in which a line search finds no way
        ends = solve_ends(ends, near)
    if not held:  # copies are averages, and their ends near ones
        near = setup.every.problem()
        ends = [approach(near, end.x) for end in ends]
    end, predicted, active = polish(near, pick_least_slow(setup, ends), finished=SOLVE_SETTLED)
    if predicted > CONVERGED:  # far from a parabola
        near = with_second_derivatives(near)
        steps = LONG_WAY if held else LONG_WAY_MOVING
        end, predicted, active = polish(near, slsqp(near, end), steps=steps, finished=SOLVE_SETTLED)
    evaluations = tried + sum(one.evaluations for one in ends) + end.evaluations
    solver = solver_verdict(
        predicted, evaluations, costs or [one.cost for one in ends], [near.names(i) for i in active]
    )
    return Solved(setup, end.x, end.cost, solver)


def fit_near(setup: Setup, x: Array) -> Solved:
    """The fit near x, on every sample.

    Where a dead time that is an unknown falls on a sample the cost has a bend, and no derivative there says that it is
    least: what is left is then solved with the dead time held.
    """
    solved, at = finish(setup, [x]), setup.at("dead")
    if solved.solver.converged or at < 0:
        return solved
    theta = float(solved.x[at])
    others = tuple(name for name in setup.extras if name != "dead")
    held = finish(replace(setup, extras=others, dead_time_s=theta), [np.delete(solved.x, at)])
    if not held.solver.converged or held.cost > solved.cost * (1 + AT_BEND):
        return solved
    return replace(solved, x=np.insert(held.x, at, theta), cost=held.cost, solver=held.solver)


def come_near(setup: Setup, x: Array) -> Solved:
    """Next to where `fit_near` would end, as far as fits are compared: the way to the very end may be long."""
    end = approach(setup.problem(), x, near=COMPARED)
    if not all(one.log.stepwise for one in setup.copies):  # of which these are but averages
        end = approach(setup.every.problem(), end.x, near=COMPARED)
    return Solved(setup, end.x, end.cost, solver_verdict(0.0, end.evaluations, [end.cost]))


def fit_through(solved: Solved, form: Form) -> Solved:
    """A fit with another form of T_s(u), as with its values at some inputs as unknowns, (L,), in place of a curve's
    coefficients."""
    fitted, first = solved.fitted, solved.fitted.model.slices[0].stop
    through = replace(fitted, model=replace(fitted.model, Ts=form))
    begin = solved.curves(form.inputs).steady
    if not isinstance(form, PerLevel):  # whose unknowns are the values themselves
        begin = np.asarray(np.linalg.solve(form.rows(form.inputs), begin))
    return fit_near(through, np.append(begin, solved.x[first:]))


def pick_least_slow(setup: Setup, ends: Sequence[EndPoint]) -> EndPoint:
    """The end of least cost; of ends that the data cannot tell apart the one with the shortest τ2.

    What has one time constant is explained as well by a slow part that never comes, and a T_s larger by what it hides.
    """
    best, part = min(ends, key=lambda end: end.cost), setup.model.slices[2]
    samples = sum(np.count_nonzero(drive.w) for drive in setup.every.drives)
    alike = [end for end in ends if end.cost <= (1 + CHI2_APART / samples) * best.cost]
    if setup.model.tau2 is None or len(alike) < 2:
        return best
    rows = setup.model.tau2.rows(setup.model.limited)
    return min(alike, key=lambda end: float((rows @ end.x[part]).max()))


def plant_found(solved: Solved) -> Plant:
    """The fitted plant, with its dead time, and with what falls have of their own where that was fitted."""
    setup, x = solved.setup, solved.x
    found: dict[str, Any] = {"dead_time_s": setup.dead_time_of_plant(x)}
    for name, extra in (("release", "rest"), ("falls", "fall")):
        if (at := setup.at(extra)) >= 0:
            found[name] = (float(x[at]), float(x[at + (setup.model.tau2 is not None)]))
    if (at := setup.at("excess")) >= 0:
        found["excess"] = float(x[at])
    if setup.falls_as_left:
        middle = solved.curves(np.array([0.5 * (setup.model.low + setup.model.high)]))
        found |= {"release_as_left": True, "release": (float(middle.tau1[0]), float(middle.tau2[0]))}
    idles = [idle_found(solved, k) + (one.log.baseline or 0.0) for k, one in enumerate(setup.copies)]
    found["idle"] = median(idles) if idles else 0.0
    return replace(setup.model.parameters(solved.coefficients), **found)


def idle_found(solved: Solved, log: int) -> float:
    """Idle output of a log, fitted or known to be 0 after its baseline."""
    at = int(solved.setup.places[log].own[0])
    return float(solved.x[at]) if at >= 0 else 0.0


def start_states(solved: Solved, log: int) -> tuple[float, float]:
    """The states at the first row of a log, in the coordinates of the plant that the fit gives."""
    one, two = (float(solved.x[at]) if at >= 0 else 0.0 for at in solved.setup.places[log].own[1:3])
    model, p = solved.setup.model, plant_found(solved)
    if model.kind != "swing" or p.zeta is not None:
        return one, two
    drive = solved.setup.drives[log]
    tables, (tau1, tau2) = solved.curves(drive.duty[drive.which[:1]]), p.time_constants(drive.duty[drive.which[0]])
    tau, zeta, z = tables.tau1[0], tables.tau2[0], solved.coefficients[-1]
    # two lags in parallel with the same output and the same rate of it
    rates = np.array([[1.0, 1.0], [-1 / tau1, -1 / tau2]])
    found = np.linalg.solve(rates, [one + z * two, (two - z * one - 2 * zeta * z * two) / tau])
    return float(found[0]), float(found[1])
