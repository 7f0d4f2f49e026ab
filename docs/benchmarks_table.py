"""The table of docs/benchmarks.md: `python docs/benchmarks_table.py` writes it between the page's marks.

The data of nonlinearbenchmark.org are fetched by `nonlinear_benchmarks` (pip install nonlinear-benchmarks); without it,
or without a network, these rows stay as they stand. Certified values of NIST and lme4 are small enough to stand here.
"""

import importlib
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import eaid
from eaid.apparatus import Apparatus
from eaid.estimate.mixed import MixedValues, fit_restricted
from eaid.steps.stepset import Level

PAGE = Path(__file__).with_name("benchmarks.md")
BEGIN, END = "<!-- benchmarks_table.py: begin -->\n", "<!-- benchmarks_table.py: end -->\n"
COLUMNS = {"time": "time_s", "input": "u (V)", "output": "y (V)"}
BOXBOD = ([1, 2, 3, 5, 7, 10], [109, 149, 149, 191, 213, 224])
DYESTUFF = [
    [1545, 1440, 1440, 1520, 1580], [1540, 1555, 1490, 1560, 1495], [1595, 1550, 1605, 1510, 1560],
    [1445, 1440, 1595, 1465, 1545], [1595, 1630, 1515, 1635, 1625], [1520, 1455, 1450, 1480, 1445],
]  # fmt: skip


def log(folder: Path, name: str, data: Any) -> Path:
    """A data set as CSV."""
    t = np.arange(len(data.u)) * data.sampling_time
    path = folder / f"{name}.csv"
    pd.DataFrame(dict(zip(COLUMNS.values(), (t, data.u, data.y), strict=True))).to_csv(path, index=False)
    return path


def outside(train: Any, test: Any) -> str:
    """Root mean square error of one log's model on another, behind the samples left for the state."""
    reading = eaid.ReadOptions(columns=COLUMNS, logs_as="recorded")
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        try:
            fit = eaid.fit(eaid.read(log(folder, "train", train), options=reading))
            run = eaid.simulate(fit, log=log(folder, "test", test), reading=reading)
        except eaid.DataError as refused:
            return f"refused: {str(refused).split(': ', 1)[1].split(' (')[0]}"
    frame = run.to_frame()
    missed = (frame["reference_nm"] - frame["torque_nm"]).to_numpy()[test.state_initialization_window_length or 0 :]
    return f"{np.sqrt(np.mean(missed**2)):.3g} V; {'usable' if fit.verdict.usable else 'told NOT USABLE'}"


def fetched(name: str, which: int | None = None) -> str:
    """Our answer to a set of nonlinearbenchmark.org."""
    try:
        train, test = getattr(importlib.import_module("nonlinear_benchmarks"), name)()
    except Exception as missing:  # of its loader, which has no error of its own for a missing network
        print(f"{name}: {missing}", file=sys.stderr)
        return ""
    return outside(train, test) if which is None else outside(train[which], test[which])


def boxbod() -> str:
    """Gain and rate of one level of the linear model."""
    level = Level(1.0, np.array(BOXBOD[0], float), np.array(BOXBOD[1:], float), ("BoxBOD",))
    steps = eaid.StepSet("clutch", "%", "N·m", Apparatus(), (level,))
    (row,) = eaid.fit(steps, model=("linear",), ci="none").linear.per_level  # type: ignore[union-attr]
    return f"{row.gain:.6f}, {row.a0:.8f}"


def dyestuff() -> str:
    """Variance between batches and within."""
    batch = np.repeat(np.arange(6), 5)
    same = (batch[:, None] == batch).astype(float)
    line = fit_restricted(
        MixedValues(np.ravel(DYESTUFF).astype(float), np.ones((30, 1)), np.zeros((30, 30)), (same, np.eye(30)))
    )
    return f"{line.v[0]:.2f}, {line.v[1]:.2f}"


SITE = "[nonlinearbenchmark.org](https://www.nonlinearbenchmark.org)"
RELAN = "Relan et al. 2017, as [quoted](https://doi.org/10.1155/2021/6613425)"
ROWS: tuple[tuple[str, str, str, Callable[[], str]], ...] = (
    ("cascaded tanks, RMSE on the second log",
     "0.18 V, a grey box that knows of the overflow; black boxes 0.33 to 0.40 V", SITE,
     lambda: fetched("Cascaded_Tanks")),
    ("the same", "0.34 V, nonlinear state space; 0.76 V, the best linear approximation", RELAN, lambda: "as above"),
    ("coupled drives, low record, RMSE on its loader's test samples", "0.10 V", SITE, lambda: fetched("CED", 0)),
    ("coupled drives, high record", "the same", SITE, lambda: fetched("CED", 1)),
    ("EMPS, position of a drive", "an integrator: identified in closed loop", SITE, lambda: fetched("EMPS")),
    ("NIST StRD BoxBOD: b1, b2", "213.809409, 0.54723749, certified",
     "[NIST](https://www.itl.nist.gov/div898/strd)", boxbod),
    ("Dyestuff: variance between batches, within", "1764.05, 2451.25", "lme4, Bates et al. 2015", dyestuff),
)  # fmt: skip


def table(before: str) -> str:
    """The Markdown table; rows whose data cannot be fetched as they stand."""
    stands = {row.split(" | ")[0][2:]: row.rstrip(" |").split(" | ")[-1] for row in before.splitlines()}

    def lines() -> Iterator[str]:
        yield "| set | published | source | ours |\n|---|---|---|---|\n"
        for what, published, source, ours in ROWS:
            yield f"| {what} | {published} | {source} | {ours() or stands.get(what, 'not measured: no data')} |\n"

    return "".join(lines())


if __name__ == "__main__":
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    PAGE.write_text(before + BEGIN + table(rest.split(END)[0]) + END + rest.split(END)[1], encoding="utf-8")
