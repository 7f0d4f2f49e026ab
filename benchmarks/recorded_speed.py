"""How long a recorded log takes, against SciPy's `least_squares` and lmfit on the same simulated residuals (numba).

The others begin at our own first start and difference the response that our kernel simulates: what they lack are the
exact sensitivities, not a compiled simulator. Run: python -m benchmarks.recorded_speed
"""

import time
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from benchmarks.table import Row
from eaid.recorded import model
from eaid.recorded.fit import fit_recorded
from eaid.recorded.kernel import response
from eaid.recorded.log import RecordedLog, levels_of, recorded_log
from eaid.recorded.options import RecordedOptions
from eaid.recorded.problem import Setup, setup_of
from eaid.recorded.solve import Solved, solve
from eaid.recorded.starts import starts
from eaid.synth.disturbance import NONE
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.plants import clutch

NOISE = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)


def log_of(duration_s: float, seed: int = 0, kind: str = "random") -> RecordedLog:
    e = Excitation(kind, duration_s)
    return recorded_log(synthesise_excitation(clutch(), e, NOISE, seed)[0])


def setup_for(log: RecordedLog) -> Setup:
    return setup_of(model.nonlinear(levels_of([log]), 0.85, float(log.time_s[-1])), [log])


def solved(log: RecordedLog) -> Solved:
    """The nonlinear model of a log, copies and starts included."""
    return solve(setup_for(log))


def timed(task) -> tuple[float, object]:  # type: ignore[no-untyped-def]
    start = time.process_time()
    found = task()
    return time.process_time() - start, found


def missed_by(setup: Setup):  # type: ignore[no-untyped-def]
    """Residuals of the unknowns, by the compiled response alone."""
    drive, rows = setup.drives[0], setup.maps[0]
    out = np.empty(len(drive.dt_s))

    def missed(x: np.ndarray) -> np.ndarray:
        tables = setup.model.tables(rows, x)
        scalars = np.array([0.85, 0.0, 0.0, 1.0, 1.0, 0.0, x[-1]])
        response(
            drive.dt_s, drive.index, drive.rising, tables.steady, tables.tau1, tables.tau2, tables.rest,
            scalars, np.zeros(2), out,
        )  # fmt: skip
        return out - drive.y

    return missed


def by_scipy(setup: Setup, start: np.ndarray) -> float:
    return float(2 * least_squares(missed_by(setup), start, x_scale="jac", ftol=1e-12, xtol=1e-12, gtol=1e-12).cost)


def by_lmfit(setup: Setup, start: np.ndarray) -> float:
    import lmfit

    missed = missed_by(setup)
    names = [f"x{k}" for k in range(len(start))]
    parameters = lmfit.Parameters()
    for name, value in zip(names, start, strict=True):
        parameters.add(name, value=float(value))
    found = lmfit.minimize(lambda p: missed(np.array([p[name].value for name in names])), parameters, ftol=1e-12)
    return float(found.chisqr)


def rows() -> list[Row]:
    log = log_of(240.0)
    setup = setup_for(log)
    solved(log)  # compiled
    ours_s, found = min((timed(lambda: solved(log)) for _ in range(3)), key=lambda one: one[0])
    begin = starts(setup.drawn, setup.drawn.problem())[0]
    made = []
    for name, task in (("SciPy least_squares", by_scipy), ("lmfit", by_lmfit)):
        other_s, cost = min((timed(lambda task=task: task(setup, begin)) for _ in range(2)), key=lambda one: one[0])
        accuracy = f"cost {cost / found.cost - 1:+.1e} of ours"  # type: ignore[attr-defined]
        made.append(
            Row("nonlinear model, 240 s of random steps at 1 kHz", "eaid", ours_s, name, other_s, "≥ 20 × faster",
                other_s >= 20 * ours_s, accuracy)
        )  # fmt: skip
    whole_s, _ = timed(lambda: fit_recorded([log], RecordedOptions()))
    ten = [log_of(240.0, seed) for seed in range(10)]
    ten_s, _ = timed(lambda: fit_recorded(ten, RecordedOptions()))
    made.append(
        Row("all models, intervals, falls: 240 s at 1 kHz", "eaid", whole_s, "bar", 3.0, "under 3 s", whole_s < 3)
    )
    made.append(Row("the same of ten such logs together", "eaid", ten_s, "bar", 20.0, "under 20 s", ten_s < 20))
    longer = []
    for duration_s in (240.0, 960.0):
        long = log_of(duration_s)
        longer.append(min(timed(lambda long=long: solved(long))[0] for _ in range(3)))
    made.append(
        Row("four times as many samples", "eaid, 960 s", longer[1], "eaid, 240 s", longer[0], "≤ 5 × the time",
            longer[1] <= 5 * longer[0])
    )  # fmt: skip
    return made


if __name__ == "__main__":
    from benchmarks.table import machine, markdown

    print(f"Measured on {machine()}.\n\n{markdown(rows())}")
