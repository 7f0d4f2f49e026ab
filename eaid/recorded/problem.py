"""The sum of squares of some logs as a `Problem` of the solver of the step fits.

Unknowns x: the model's coefficients; where asked for, τ1 and τ2 of a fall to rest, factors on τ1 and τ2 of a fall
between levels, and the excess of T_s after a fall of the input; then of each log its idle output and start states,
where they are not known.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.problem import ROUNDING, Problem
from eaid.models.parameters import TAU_FLOOR_S
from eaid.recorded.adjoint import by_holds
from eaid.recorded.drive import Copies, Drive
from eaid.recorded.log import RecordedLog
from eaid.recorded.model import Model, Rows
from eaid.recorded.sensitivities import derivatives
from eaid.recorded.states import Tables

NOTHING = {"rest": (0.0, 0.0), "fall": (1.0, 1.0), "excess": (0.0,)}
"""What a model can have besides its coefficients, with the values that do nothing."""
LIMITS: dict[str, tuple[tuple[str, tuple[float, ...], float], ...]] = {
    "rest": (
        ("release-tau1-floor", (1.0, 0.0), TAU_FLOOR_S),
        ("release-tau2-meets-tau1", (-1.0, 1.0), 0.0),
    ),
    "fall": (("fall-tau1-least", (1.0, 0.0), 0.02), ("fall-tau2-least", (0.0, 1.0), 0.02)),
    "excess": (("hysteresis-least", (1.0,), -0.8),),
}
"""Their constraints a'x ≥ b: code, a, b."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where the unknowns of a log lie, beside the coefficients of T_s, τ1 and τ2."""

    x: NDArray[np.intp]
    """In x: C, the extras, idle output, x1 and x2 at its first row; −1 where one is no unknown, (9,)."""
    columns: NDArray[np.intp]
    """Places in x of all unknowns that it knows, in the kernel's order."""
    kernel: NDArray[np.intp]
    """As `x`, among these columns."""

    @property
    def own(self) -> NDArray[np.intp]:
        """Idle output and start states in x, (3,)."""
        return self.x[6:]


Together = Callable[[Array], tuple[float, Array, Array]]


@dataclass(frozen=True, eq=False)
class Setup:
    """Logs and a model: everything but the unknowns."""

    model: Model
    drives: tuple[Drive, ...]
    """The logs in numbers."""
    extras: tuple[str, ...] = ()
    idle_free: bool = True
    """Whether idle outputs that are not known are unknowns; else they are 0."""
    copies: tuple[Copies, ...] = ()
    """Where `drives` are but copies in fewer rows: the logs themselves."""

    @cached_property
    def every(self) -> "Setup":
        """The same on every sample."""
        return replace(self, drives=tuple(one.every for one in self.copies)) if self.copies else self

    @cached_property
    def drawn(self) -> "Setup":
        """The same on a sketch, on which many starts are looked at."""
        return replace(self, drives=tuple(one.sketch for one in self.copies)) if self.copies else self

    @cached_property
    def maps(self) -> tuple[Rows, ...]:
        """What the model makes of each log's inputs."""
        return tuple(self.model.rows_of(drive.duty) for drive in self.drives)

    @cached_property
    def shared(self) -> int:
        """Unknowns that all logs share."""
        return self.model.size + sum(len(NOTHING[name]) for name in self.extras)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Where the unknowns of each log lie."""
        shared = [self.model.size - 1 if self.model.share is None else -1]
        for name, none in NOTHING.items():
            at = self.at(name)
            shared += [at + k if at >= 0 else -1 for k in range(len(none))]
        found, before = [], self.shared
        for drive in self.drives:
            loaded = not drive.starts_idle
            free = np.array([self.idle_free and not drive.idle_known, loaded, loaded and self.model.sizes[2] > 0])
            order = np.cumsum(free) - 1
            own, local = (np.where(free, first + order, -1) for first in (before, self.shared))
            columns = np.concatenate([np.arange(self.shared), own[free]])
            found.append(Place(np.append(shared, own), columns, np.append(shared, local)))
            before += int(free.sum())
        return tuple(found)

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return self.shared + sum(len(place.columns) - self.shared for place in self.places)

    @cached_property
    def samples(self) -> int:
        """Samples that are compared."""
        return sum(drive.samples for drive in self.drives)

    @cached_property
    def energy(self) -> float:
        """Weighted sum of the squared outputs about each log's mean."""
        total = 0.0
        for drive in self.drives:
            mean = float(drive.w @ drive.y) / float(drive.w.sum())
            total += float(drive.w @ (drive.y - mean) ** 2) + drive.left
        return total

    def at(self, name: str) -> int:
        """First place of an extra in x; −1 where it is no unknown."""
        if name not in self.extras:
            return -1
        before = self.extras[: self.extras.index(name)]
        return self.model.size + sum(len(NOTHING[one]) for one in before)

    def tables(self, x: Array, log: int) -> tuple[Tables, Array]:
        """T_s, τ1, τ2 of a log's inputs, and the nine numbers beside them."""
        at, given = self.places[log].x, (self.model.share or 0.0, *itertools.chain(*NOTHING.values()), 0.0, 0.0, 0.0)
        return self.model.tables(self.maps[log], x), np.where(at >= 0, x[at], given)

    def derivatives(self, x: Array, log: int) -> Array:
        """√w ∂f/∂x of a log's own columns, then √w (f − y), for its samples that count, (N, p + 1)."""
        place = self.places[log]
        return np.asarray(derivatives(self.drives[log].rows, *self.tables(x, log), place.kernel, len(place.columns)))

    def jacobian(self, x: Array, log: int) -> tuple[Array, Array]:
        """The same apart, (N, p) and (N,)."""
        found = self.derivatives(x, log)
        return found[:, :-1], found[:, -1]

    def together(self, x: Array) -> tuple[float, Array, Array]:
        """Cost, gradient and Gauss–Newton matrix."""
        cost, gradient, curvature = 0.0, np.zeros(self.size), np.zeros((self.size, self.size))
        for log, drive in enumerate(self.drives):
            at, found = self.places[log].columns, self.derivatives(x, log)
            P = 2.0 * found.T @ found
            cost += 0.5 * float(P[-1, -1]) + drive.left
            gradient[at] += P[-1, :-1]
            curvature[np.ix_(at, at)] += P[:-1, :-1]
        return cost, gradient, curvature

    def on_every_sample(self, x: Array) -> tuple[float, Array]:
        """Cost and gradient over every sample of the logs themselves, hold by hold: inputs are held."""
        cost, gradient = 0.0, np.zeros(self.size)
        for log, copy in enumerate(self.copies):
            holds, (tables, scalars), place = copy.holds, self.tables(x, log), self.places[log]
            dt_s = copy.log.dt_s if copy.log.even_s is None else np.array([copy.log.even_s])
            squares, by_input, by_scalar = by_holds(
                holds.first, holds.index, holds.rising, dt_s, copy.above, tables, scalars
            )
            maps = (tables.by_steady, tables.by_tau1, tables.by_tau2)
            slopes = np.concatenate([by @ rows for by, rows in zip(by_input, maps, strict=True)])
            gradient[: len(slopes)] += 2.0 * copy.log.weight * slopes
            gradient[place.x[place.x >= 0]] += 2.0 * copy.log.weight * by_scalar[place.x >= 0]
            cost += copy.log.weight * squares
        return cost, gradient

    def problem(self) -> Problem:
        """For the solver: constraints of the model, and of the extras."""
        model = self.model
        more = [(self.at(name), *one) for name in self.extras for one in LIMITS[name]]
        A = np.zeros((len(model.A) + len(more), self.size))
        A[: len(model.A), : model.A.shape[1]] = model.A
        for row, (at, _, along, _) in zip(A[len(model.A) :], more, strict=True):
            row[at : at + len(along)] = along
        b = np.append(model.b, [least for *_, least in more])

        def names(i: int) -> str:
            return model.names(i) if i < len(model.b) else more[i - len(model.b)][1]

        return Problem(remembered(self.together), A, b, names, floor=ROUNDING * self.energy)


def remembered(together: Together) -> Together:
    """The same, with its last answer at hand: cost and curvature of a place are asked for one after another."""
    last: dict[bytes, tuple[float, Array, Array]] = {}

    def found(x: Array) -> tuple[float, Array, Array]:
        place = x.tobytes()
        if place not in last:
            last.clear()
            last[place] = together(x)
        return last[place]

    return found


def setup_of(model: Model, logs: Sequence[RecordedLog], idle_free: bool = True) -> Setup:
    """Logs and a model, with the copies on which its fit is looked for."""
    copies = tuple(map(Copies, logs))
    return Setup(model, tuple(one.small for one in copies), (), idle_free, copies)


def with_extras(setup: Setup, extras: Sequence[str], x: Array, values: Sequence[float] | Array) -> tuple[Setup, Array]:
    """The same logs with other extras, and x with `values` for all of them in the place of the old ones."""
    fresh = replace(setup, extras=tuple(extras))
    return fresh, np.concatenate([x[: setup.model.size], np.asarray(values, dtype=float), x[setup.shared :]])
