"""What drives a plant and what it is compared with, in rows; and the plant's numbers for the inputs of those rows."""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

Integers: TypeAlias = NDArray[np.integer[Any]]
ROW_NUMBER = np.int32  # Each row of a long log has two such numbers, and 64 bits would take twice the memory


class Drive(NamedTuple):
    """What drives a plant, and what it is compared with, as the kernel takes it; shapes (n,) but for `duty`."""

    dt_s: Array  # How long a row's input acts [s]; 0 after the last
    which: Integers  # Which of `duty` acts
    duty: Array  # The different inputs, shape (m,)
    paces: Array  # Those whose time constants may act with them: of a rest the input that was left, else itself, (m,)
    rising: Integers  # −1 while an input is held to which the log fell from a higher one, else 1
    y: Array
    w: Array  # Weights; 0: a row that is not compared
    idle_known: bool
    starts_idle: bool
    left: float = 0.0  # Squares that no response of these rows can take away
    late_s: float = 0.0  # By which its input was noted late, a part of a row [s]


def beginning(drive: Drive, rows: int) -> Drive:
    """The first rows of a drive; itself where it has no more."""
    if len(drive.w) <= rows:
        return drive
    parts = {name: getattr(drive, name)[:rows] for name in ("dt_s", "which", "rising", "y", "w")}
    return drive._replace(**parts, left=0.0)


def fall_alone(drives: Sequence[Drive]) -> bool:
    """Whether inputs fall, and nowhere rise: none of the drives begins at rest."""
    changes = np.concatenate([np.diff(drive.duty[drive.which]) for drive in drives])
    return not any(drive.starts_idle for drive in drives) and bool((changes < 0).any() and (changes <= 0).all())


def later(drive: Drive, rows: int) -> Drive:
    """The same with the input of so many rows later, or earlier where they are below 0; that of an end lasts."""
    return drive._replace(which=moved_rows(drive.which, rows), rising=moved_rows(drive.rising, rows))


def moved_rows(values: NDArray[Any], rows: int) -> NDArray[Any]:
    """At each row the value of so many rows later, (n,); beyond an end that of the end."""
    end = np.full(min(abs(rows), len(values)), values[-1 if rows > 0 else 0])
    return np.concatenate([values[rows:], end] if rows > 0 else [end, values[: len(values) - len(end)]])


def delayed(drive: Drive, dead_time_s: float) -> Drive:
    """The same with every change of the input where it acts, so much later than it was made: rows of weight 0 there.

    Until the first change acts, and before the log begins, the first row's input does.
    """
    after_s = dead_time_s - drive.late_s
    if after_s == 0.0:
        return drive
    t = np.concatenate([[0.0], np.cumsum(drive.dt_s[:-1])])
    changed = (np.diff(drive.which) != 0) | (np.diff(drive.rising) != 0)
    rows = np.flatnonzero(changed) + 1
    acts = np.maximum(t[rows] + after_s, 0.0)
    rows, acts = rows[acts < t[-1]], acts[acts < t[-1]]
    at = np.searchsorted(t, acts, side="right")  # an output at that very instant comes first
    time = np.insert(t, at, acts)
    from_row = np.concatenate([[0], rows])[np.searchsorted(np.sort(acts), time, side="right")]
    sample = np.insert(np.ones(len(t), dtype=bool), at, False)
    y, w = np.zeros(len(time)), np.zeros(len(time))
    y[sample], w[sample] = drive.y, drive.w
    dt_s, whole = np.append(np.diff(time), drive.dt_s[-1]), np.flatnonzero(sample[:-1] & sample[1:])
    dt_s[whole] = drive.dt_s[(np.cumsum(sample) - 1)[whole]]  # to the last digit: kernels go on with what they know
    return drive._replace(dt_s=dt_s, which=drive.which[from_row], rising=drive.rising[from_row], y=y, w=w, late_s=0.0)


class Tables(NamedTuple):
    """T_s, τ1, τ2 (of series and ringing 1/ω and ζ) of the different inputs, (m,), and their derivatives by the
    coefficients, (m, n)."""

    steady: Array
    tau1: Array
    tau2: Array
    rest: Array  # u/u_low, at most 1: below 1 a fall goes over to the release constants
    by_steady: Array
    by_tau1: Array
    by_tau2: Array


# Places of the numbers beside the coefficients: C (z of series and ringing), τ of falls to rest, factors on those of
# falls, excess, θ, idle output, the two states at the first row, and what no plant has, how far a
# sensor creeps in a log, straight and bent
AT_SHARE, AT_REST, AT_FALL, AT_EXCESS, AT_DEAD, AT_IDLE, AT_START, AT_CREEP = 0, 1, 3, 5, 6, 7, 8, 10
