"""A closed loop fitted with the duty that it has without noise as an instrument.

Σ Z_k' r_k(θ) = 0,   Z the derivatives along that duty, r the residuals along the recorded one
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.recorded.drive import Copies, Drive
from eaid.recorded.law import law_of, simulated
from eaid.recorded.log import RecordedLog
from eaid.recorded.solve import Solved

ROUNDS = 20
RENEWED = 2
"""Instruments one after another."""


def with_instrument(base: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """The fit by instruments, begun at the direct one; the direct one where no law is known or it does not settle."""
    laws = [law_of(log) for log in logs]
    if not any(law is not None and log.starts_idle for law, log in zip(laws, logs, strict=True)):
        return base
    x, drives = base.x.copy(), list(base.setup.drives)
    for _ in range(RENEWED):  # any duty without noise serves; the second is that of a better model
        now = replace(base, x=x)
        for k, (log, law) in enumerate(zip(logs, laws, strict=True)):
            if law is not None and log.starts_idle:
                drives[k] = Copies(simulated(now, k, log, law, None)).every
        found = _solved(base, x, tuple(drives))
        if found is None:
            return base
        x = found
    problem = base.setup.problem()
    if (problem.A @ x - problem.b < -1e-9).any():
        return base
    return replace(base, x=x, cost=problem.value(x)[0], instruments=tuple(drives))


def _solved(base: Solved, x: Array, drives: tuple[Drive, ...]) -> Array | None:
    """Where Σ Z' r is 0, by Newton's steps from x; None where they do not settle."""
    clean = replace(base.setup, drives=drives)
    slopes = [clean.jacobian(x, k)[0] for k in range(len(drives))]
    for _ in range(ROUNDS):
        A, score = np.zeros((len(x), len(x))), np.zeros(len(x))
        for k in range(len(drives)):
            J, r = base.setup.jacobian(x, k)
            Z, at = slopes[k], base.setup.places[k].columns
            A[np.ix_(at, at)] += Z.T @ J
            score[at] += Z.T @ r
        scale = np.sqrt(np.maximum(np.abs(np.diagonal(A)), 1e-300))
        move = -np.linalg.solve(A / np.outer(scale, scale), score / scale) / scale
        x = x + move
        if float(np.abs(move * scale).max()) < 1e-7 * np.sqrt(base.cost):
            return x
    return None
