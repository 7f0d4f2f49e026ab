"""The statistics of Fig. 17: box plots of the absolute position error, and what may be concluded from them.

The paper tests samples against samples (Student's t after a normality test with p < 0.001, which rejects normality).
Samples 1 ms apart are no independent observations: `independent` says how many they are worth,
n / (1 + 2 Σ ρ_k) up to the first autocorrelation ρ_k that is not positive. Beside the paper's test stand two on the
means of whole movement cycles: Welch's t, and the exact rank test of Mann and Whitney with the least p it can give.
"""

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.replay import metrics, scenarios
from eaid.replay.files import Record
from eaid.replay.rehab import MODES, Session


def statistics(session: Session) -> dict[str, Any]:
    """Errors of the torque loop over all counted samples; boxes, normality and tests by mode, |position error| in °."""
    dt_s = session.replay.dt_s
    error_deg = {mode: np.abs(session.position_error_deg[session.counted(mode)]) for mode in MODES}
    cycle = round(1 / session.exercise.movement_hz / dt_s)
    means = {mode: cycle_means(values, cycle) for mode, values in error_deg.items()}
    return {
        **_tracking(session, np.concatenate([np.arange(len(session.mode))[session.counted(mode)] for mode in MODES])),
        "modes": {mode: _mode(session, mode, error_deg[mode], means[mode]) for mode in MODES},
        "turn_step_nm": session.turn_step_nm,
        "normality": {mode: normality(values) for mode, values in error_deg.items()},
        "tests": [
            {"modes": list(pair), "samples": by_samples(*(error_deg[mode] for mode in pair)),
             "cycles": by_cycles(*(means[mode] for mode in pair))}
            for pair in itertools.combinations(MODES, 2)
        ],
    }  # fmt: skip


def record(session: Session) -> Record:
    """A session as a group of replay.h5: the torque loop, the limb, and the statistics."""
    found = statistics(session)
    loop = scenarios.record(session.replay, found)
    return Record({**loop.columns, **session.columns()}, found)


def _mode(session: Session, mode: str, error_deg: Array, means: Array) -> dict[str, Any]:
    part = session.counted(mode)
    torque = np.abs(session.torque_error_nm[part])
    return {
        "abs_position_error_deg": box(error_deg),
        "cycle_means_deg": means.tolist(),
        "mean_abs_torque_error_nm": float(torque.mean()),
        "max_abs_torque_error_nm": float(torque.max()),
        "torque_loop": _tracking(session, part),
    }


def _tracking(session: Session, part: slice | NDArray[np.int64]) -> metrics.Metrics:
    replay = session.replay
    return metrics.tracking(
        replay.reference_nm[part], replay.torque_nm[part], replay.duty_pct[part], replay.dt_s, replay.limits_pct
    )


def box(values: Array) -> dict[str, float]:
    """The numbers of a box plot: quartiles (linear), whiskers within 1.5 quartile ranges, outliers."""
    q1, median, q3 = (float(q) for q in np.percentile(values, [25, 50, 75]))
    reach = 1.5 * (q3 - q1)
    inside = values[(values >= q1 - reach) & (values <= q3 + reach)]
    return {
        "n": values.size,
        "independent": independent(values),
        "mean": float(values.mean()),
        "sd": float(values.std(ddof=1)),
        "q1": q1,
        "median": median,
        "q3": q3,
        "whisker_low": float(inside.min()),
        "whisker_high": float(inside.max()),
        "outliers": values.size - inside.size,
    }


def independent(values: Array) -> float:
    """How many independent observations a series is worth, n / (1 + 2 Σ ρ_k), k up to the first ρ_k ≤ 0."""
    n = values.size
    away = values - values.mean()
    power = float(away @ away)
    if power == 0.0:
        return 1.0
    spectrum = np.abs(np.fft.rfft(away, 2 * n)) ** 2
    rho = np.fft.irfft(spectrum)[:n] / power
    ends = np.flatnonzero(rho <= 0)
    last = int(ends[0]) if ends.size else n
    return min(float(n), n / (1 + 2 * float(rho[1:last].sum())))


def cycle_means(values: Array, cycle: int) -> Array:
    """Mean over each whole movement cycle of so many samples, from the first sample on."""
    whole = values.size // cycle
    means: Array = values[: whole * cycle].reshape(whole, cycle).mean(axis=1)
    return means


def normality(values: Array) -> dict[str, Any]:
    """D'Agostino and Pearson's K² on all samples; a small p says that they are not normal."""
    from scipy import stats

    found = stats.normaltest(values)
    return {"test": "D'Agostino-Pearson", "statistic": float(found.statistic), "p": float(found.pvalue),
            "rejected": bool(found.pvalue < 0.05)}  # fmt: skip


def by_samples(first: Array, second: Array) -> dict[str, Any]:
    """The paper's test: Student's t with pooled variance on all samples, as if they were independent."""
    from scipy import stats

    found = stats.ttest_ind(first, second)
    return {"test": "Student, samples taken as independent", "n": [first.size, second.size],
            "t": float(found.statistic), "p": float(found.pvalue)}  # fmt: skip


def by_cycles(first: Array, second: Array) -> dict[str, Any]:
    """Welch's t and the exact rank test on the means of movement cycles; None where too few cycles are whole."""
    from scipy import stats

    n, m = first.size, second.size
    result: dict[str, Any] = {"n": [n, m], "t": None, "df": None, "p_welch": None, "U": None, "p_rank": None,
                              "least_p_rank": 2 / math.comb(n + m, n) if min(n, m) else None}  # fmt: skip
    if min(n, m) == 0:
        return result
    rank = stats.mannwhitneyu(first, second, method="exact")
    result |= {"U": float(rank.statistic), "p_rank": float(rank.pvalue)}
    if min(n, m) >= 2:
        of_means = np.var(first, ddof=1) / n, np.var(second, ddof=1) / m
        spread = float(sum(of_means))
        if spread > 0:
            t = float(first.mean() - second.mean()) / math.sqrt(spread)
            df = spread**2 / float(of_means[0] ** 2 / (n - 1) + of_means[1] ** 2 / (m - 1))
            result |= {"t": t, "df": df, "p_welch": 2 * float(stats.t.sf(abs(t), df))}
    return result
