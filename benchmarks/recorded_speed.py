"""How long a recorded log takes, against SciPy's `least_squares` and lmfit on the same simulated residuals (numba).

Twice: from one start, the first of ours, in the right bowl, for everybody; and with our own search for starts, which
the others are spared. All end where another step would gain less than 1e-9 of the cost. `least_squares` runs with its
own finite differences and with our exact derivatives. Processor time, and wall time beside it.
Run: python -m benchmarks.recorded_speed
"""

import time
from dataclasses import replace

import numpy as np
from eaid.recorded.options import RecordedOptions
from scipy.optimize import least_squares

from benchmarks.table import Row
from eaid.recorded import model
from eaid.recorded.fit import fit_recorded
from eaid.recorded.inputs import levels_of
from eaid.recorded.log import RecordedLog, recorded_log
from eaid.recorded.problem import Setup, setup_of
from eaid.recorded.solve import Solved, finished, solve
from eaid.recorded.starts import starts
from eaid.recorded.states import response
from eaid.synth.disturbance import NONE
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.plants import clutch

ENOUGH = 1e-9
"""Where the others stop; our own verdict asks for the same."""
NOISE = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)


def log_of(duration_s: float, seed: int = 0, kind: str = "random") -> RecordedLog:
    e = Excitation(kind, duration_s)
    return recorded_log(synthesise_excitation(clutch(), e, NOISE, seed)[0])


def setup_for(log: RecordedLog) -> Setup:
    return setup_of(model.nonlinear(levels_of([log]), 0.85, float(log.time_s[-1])), [log])


def solved(log: RecordedLog) -> Solved:
    """The nonlinear model of a log, copies and starts included."""
    return solve(setup_for(log))


def timed(task, times: int = 7) -> tuple[float, float, object]:  # type: ignore[no-untyped-def]
    """Least processor and wall time [s] of some runs, and what the last one gave."""
    spent = []
    for _ in range(times):
        cpu, wall = time.process_time(), time.perf_counter()
        found = task()
        spent.append((time.process_time() - cpu, time.perf_counter() - wall))
    return *map(min, zip(*spent, strict=True)), found  # type: ignore[return-value]


def missed_by(setup: Setup):  # type: ignore[no-untyped-def]
    """Residuals of the unknowns on every sample, by the compiled response alone."""
    drive, rows = setup.every.drives[0], setup.maps[0]

    def missed(x: np.ndarray) -> np.ndarray:
        tables = setup.model.tables(rows, x)
        scalars = np.array([0.85, 0.0, 0.0, 1.0, 1.0, 0.0, x[-1], 0.0, 0.0])
        out = response(
            drive.dt_s, drive.index, drive.rising, tables.steady, tables.tau1, tables.tau2, tables.rest, scalars
        )
        return np.asarray(out - drive.y)

    return missed


def by_scipy(setup: Setup, start: np.ndarray, exact: bool = False) -> float:
    jac = (lambda x: setup.every.jacobian(x, 0)[0]) if exact else "2-point"
    found = least_squares(missed_by(setup), start, jac, x_scale="jac", ftol=ENOUGH, xtol=ENOUGH, gtol=ENOUGH)  # type: ignore[call-overload]
    return float(2 * found.cost)


def by_lmfit(setup: Setup, start: np.ndarray) -> float:
    import lmfit

    missed = missed_by(setup)
    names = [f"x{k}" for k in range(len(start))]
    parameters = lmfit.Parameters()
    for name, value in zip(names, start, strict=True):
        parameters.add(name, value=float(value))
    found = lmfit.minimize(
        lambda p: missed(np.array([p[name].value for name in names])), parameters, ftol=ENOUGH, xtol=ENOUGH
    )
    return float(found.chisqr)


OTHERS = {
    "SciPy least_squares": by_scipy,
    "SciPy least_squares, our derivatives": lambda setup, start: by_scipy(setup, start, True),
    "lmfit": by_lmfit,
}


def against(duration_s: float) -> list[Row]:
    """One log, everybody."""
    log = log_of(duration_s)
    setup = setup_for(log)
    begin = starts(setup.drawn, setup.drawn.problem())[0]
    ours = {
        "from one start": timed(lambda: finished(setup_for(replace(log)), [begin])),
        "with the search for starts": timed(lambda: solved(replace(log))),  # a log that has nothing at hand
    }
    made = []
    for name, task in OTHERS.items():
        cpu_s, wall_s, cost = timed(lambda task=task: task(setup, begin), 5)
        for how, (own_s, own_wall_s, found) in ours.items():
            over = f"cost {cost / found.cost - 1:+.0e} of ours; wall {1e3 * own_wall_s:.0f} and {1e3 * wall_s:.0f} ms"
            made.append(
                Row(f"nonlinear model, {duration_s:.0f} s of random steps at 1 kHz, {how}", "eaid", own_s, name, cpu_s,
                    "≥ 20 × faster", cpu_s >= 20 * own_s, over)
            )  # fmt: skip
    return made


def rows() -> list[Row]:
    log = log_of(240.0)
    solved(log)  # compiled
    made = against(240.0) + against(960.0)
    whole_s, wall_s, _ = timed(lambda: fit_recorded([log], RecordedOptions()), 2)
    ten = [log_of(240.0, seed) for seed in range(10)]
    ten_s, ten_wall_s, _ = timed(lambda: fit_recorded(ten, RecordedOptions()), 1)
    what = "all models, intervals, falls: 240 s at 1 kHz"
    made.append(Row(what, "eaid", whole_s, "bar", 3.0, "under 3 s", whole_s < 3, f"wall {wall_s:.2g} s"))
    what = "the same of ten such logs together"
    made.append(Row(what, "eaid", ten_s, "bar", 20.0, "under 20 s", ten_s < 20, f"wall {ten_wall_s:.2g} s"))
    long = log_of(960.0)
    longer = [timed(lambda one=one: solved(replace(one)))[0] for one in (log, long)]
    made.append(
        Row("four times as many samples", "eaid, 960 s", longer[1], "eaid, 240 s", longer[0], "≤ 5 × the time",
            longer[1] <= 5 * longer[0])
    )  # fmt: skip
    return made


if __name__ == "__main__":
    from benchmarks.table import machine, markdown

    print(f"Measured on {machine()}.\n\n{markdown(rows())}")
