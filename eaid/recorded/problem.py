"""The sum of squares of some logs as a `Problem` of the solver of the step fits.

Unknowns x: the model's coefficients; where asked for, τ1 and τ2 of a fall to rest, factors on τ1 and τ2 of a fall
between levels, and the excess of T_s after a fall of the input; then of each log its idle output and start states,
where they are not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.problem import ROUNDING, Problem
from eaid.models.parameters import TAU_FLOOR_S
from eaid.recorded.drive import Drive, copies_of, drive_of
from eaid.recorded.kernel import products, rows
from eaid.recorded.log import RecordedLog
from eaid.recorded.model import Model, Rows

EXTRAS = {"rest": 2, "fall": 2, "excess": 1}
"""What a model can have besides its coefficients, and how many unknowns each is."""
VECTOR = 16
"""Columns that the kernel takes at once."""


@dataclass(frozen=True, eq=False)
class Setup:
    """Logs and a model: everything but the unknowns."""

    model: Model
    drives: tuple[Drive, ...]
    """Every sample of every log."""
    extras: tuple[str, ...] = ()
    idle_free: bool = True
    """Whether idle outputs that are not known are unknowns; else they are 0."""
    small: tuple[Drive, ...] = ()
    """The logs in fewer rows, on which the fit is looked for; none: every sample."""
    sketch: tuple[Drive, ...] = ()
    """Still fewer rows, on which many starts are looked at; none: as `small`."""
    logs: tuple[RecordedLog, ...] = ()
    """What they were made of."""

    @cached_property
    def quick(self) -> "Setup":
        """The same on `small`."""
        return replace(self, drives=self.small, small=()) if self.small else self

    @cached_property
    def drawn(self) -> "Setup":
        """The same on `sketch`."""
        return replace(self, drives=self.sketch, small=(), sketch=()) if self.sketch else self.quick

    @cached_property
    def maps(self) -> tuple[Rows, ...]:
        """What the model makes of each log's inputs."""
        return tuple(self.model.rows_of(drive.duty) for drive in self.drives)

    @cached_property
    def shared(self) -> int:
        """Unknowns that all logs share."""
        return self.model.size + sum(EXTRAS[name] for name in self.extras)

    @cached_property
    def own(self) -> tuple[NDArray[np.intp], ...]:
        """Where each log's idle output, x1 and x2 at its start lie in x; −1 where they are known, each (3,)."""
        found, at = [], self.shared
        for drive in self.drives:
            free = [self.idle_free and not drive.idle_known, not drive.starts_idle, not drive.starts_idle]
            if self.model.sizes[2] == 0:
                free[2] = False
            found.append(np.array([at + sum(free[:k]) if one else -1 for k, one in enumerate(free)]))
            at += sum(free)
        return tuple(found)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.shared + sum(int((own >= 0).sum()) for own in self.own)

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
            total += float(drive.w @ (drive.y - mean) ** 2)
        return total

    def at(self, name: str) -> int:
        """First place of an extra in x; −1 where it is no unknown."""
        if name not in self.extras:
            return -1
        before = self.extras[: self.extras.index(name)]
        return self.model.size + sum(EXTRAS[one] for one in before)

    def columns(self, log: int) -> NDArray[np.intp]:
        """Places in x of the unknowns that a log knows, in the kernel's order."""
        own = self.own[log]
        return np.concatenate([np.arange(self.shared), own[own >= 0]])

    def arguments(self, x: Array, log: int) -> tuple[Any, ...]:
        """Everything that the kernel takes after the range of rows, `state` and `sens` fresh."""
        drive, model = self.drives[log], self.model
        tables = model.tables(self.maps[log], x)
        own = self.own[log]
        start = np.array([x[k] if k >= 0 else 0.0 for k in own])
        local = np.where(own >= 0, self.shared + np.cumsum(own >= 0) - 1, -1)
        share = x[model.size - 1] if model.share is None else model.share
        rest, fall, excess = (self.at(name) for name in ("rest", "fall", "excess"))
        scalars = np.array(
            [
                share,
                *(x[rest : rest + 2] if rest >= 0 else (0.0, 0.0)),
                *(x[fall : fall + 2] if fall >= 0 else (1.0, 1.0)),
                x[excess] if excess >= 0 else 0.0,
                start[0],
            ]
        )
        place = np.array(
            [
                model.size - 1 if model.share is None else -1,
                rest,
                rest + 1 if rest >= 0 else -1,
                fall,
                fall + 1 if fall >= 0 else -1,
                excess,
                *local,
            ]
        )
        sens = np.zeros((2, -(-(self.shared + int((own >= 0).sum())) // VECTOR) * VECTOR))
        for state, column in enumerate(local[1:]):
            if column >= 0:
                sens[state, column] = 1.0
        return (
            drive.dt_s, drive.index, drive.rising, drive.y, drive.w,
            tables.steady, tables.tau1, tables.tau2, tables.rest, tables.by_steady, tables.by_tau1, tables.by_tau2,
            scalars, place, start[1:].copy(), sens,
        )  # fmt: skip

    def together(self, x: Array) -> tuple[float, Array, Array]:
        """Cost, gradient and Gauss–Newton matrix."""
        cost, gradient, curvature = 0.0, np.zeros(self.size), np.zeros((self.size, self.size))
        for log in range(len(self.drives)):
            at = self.columns(log)
            P = 2.0 * products(*self.arguments(x, log), len(at))  # type: ignore[call-arg]
            cost += 0.5 * float(P[-1, -1]) + self.drives[log].left
            gradient[at] += P[-1, :-1]
            curvature[np.ix_(at, at)] += P[:-1, :-1]
        return cost, gradient, curvature

    def jacobian(self, x: Array, log: int) -> tuple[Array, Array]:
        """√w ∂f/∂x of a log's own columns, (N, p), and √w (f − y), (N,), for its samples that count."""
        arguments = self.arguments(x, log)
        drive = self.drives[log]
        out = np.zeros((drive.samples, arguments[-1].shape[1] + 1))
        rows(0, len(drive.dt_s), *arguments, out)  # type: ignore[call-arg]
        return np.ascontiguousarray(out[:, : len(self.columns(log))]), out[:, -1].copy()

    def problem(self) -> Problem:
        """For the solver: constraints of the model, and of the extras."""
        model, n = self.model, self.size
        A = np.zeros((len(model.A), n))
        A[:, : model.A.shape[1]] = model.A
        more, least, said = [], [], []

        def bound(name: str, at: int, value: float) -> None:
            row = np.zeros(n)
            row[at] = 1.0
            more.append(row)
            least.append(value)
            said.append(name)

        if (at := self.at("rest")) >= 0:
            bound("τ1 of the release = 1 ms", at, TAU_FLOOR_S)
            bound("τ2 of the release = 1 ms", at + 1, TAU_FLOOR_S)
            more[-1][at] = -1.0
            least[-1], said[-1] = 0.0, "τ2 = τ1 of the release"
        if (at := self.at("fall")) >= 0:
            bound("τ1 of falls = 0.02 τ1", at, 0.02)
            bound("τ2 of falls = 0.02 τ2", at + 1, 0.02)
        if (at := self.at("excess")) >= 0:
            bound("T_s after a fall = T_s/5", at, -0.8)
        if more:
            A = np.vstack([A, more])
        b = np.append(model.b, least)

        def names(i: int) -> str:
            return model.names(i) if i < len(model.b) else said[i - len(model.b)]

        return Problem(self.together, A, b, names, floor=ROUNDING * self.energy)


def setup_of(model: Model, logs: Sequence[RecordedLog], idle_free: bool = True) -> Setup:
    """Logs and a model, with the copies on which its fit is looked for."""
    small, sketch = zip(*map(copies_of, logs), strict=True)
    return Setup(model, tuple(map(drive_of, logs)), (), idle_free, small, sketch, tuple(logs))


def with_extras(setup: Setup, extras: Sequence[str], x: Array, values: Sequence[float] | Array) -> tuple[Setup, Array]:
    """The same logs with other extras, and x with `values` for all of them in the place of the old ones."""
    fresh = replace(setup, extras=tuple(extras))
    return fresh, np.concatenate([x[: setup.model.size], np.asarray(values, dtype=float), x[setup.shared :]])
