"""Whole processes: what a user waits for from the Enter key to the prompt, against bare imports and a plain script."""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.table import Row, paired_medians, process
from eaid.cli.main import COMMANDS

PYTHON = sys.executable
RUNS = 5

PLAIN_SCRIPT = """
import sys, glob, numpy as np, pandas as pd
from scipy.optimize import curve_fit

def curve(X, a0, a1, a2, b0, b1, b2, c0, c1, c2, c3):
    t, u = X
    t1 = a0 + a1 * u + a2 * u**2
    t2 = b0 + b1 * u + b2 * u**2
    return (0.85 * (1 - np.exp(-t / t1)) + 0.15 * (1 - np.exp(-t / t2))) * (c0 + c1 * u + c2 * u**2 + c3 * u**3)

runs = {}
for path in sorted(glob.glob(sys.argv[1] + "/*.csv")):
    log = pd.read_csv(path, skiprows=1)
    duty = log.duty_pct.to_numpy()
    start = int(np.argmax(duty > 0))
    stop = start + int(np.argmin(duty[start:] > 0)) if (duty[start:] == 0).any() else len(duty)
    torque = log.torque_nm.to_numpy()
    runs.setdefault(duty[start], []).append(torque[start:stop] - torque[:start].mean())
t, u, y = [], [], []
for level, repeats in sorted(runs.items()):
    n = min(map(len, repeats))
    mean = np.mean([r[:n] for r in repeats], axis=0)
    t.append(np.arange(n) / 1000), u.append(np.full(n, level)), y.append(mean)
X, y = np.array([np.concatenate(t), np.concatenate(u)]), np.concatenate(y)
start = [0.01, 0.02, -2e-4, 1, 0.4, -2e-3, 0.03, 0.01, 2e-4, 1e-6]
print(curve_fit(curve, X, y, p0=start, maxfev=20000)[0])
"""


def rows() -> Iterator[Row]:
    bare = process(PYTHON, "-c", "import typer")
    for name in ("", *COMMANDS):
        command = process(PYTHON, "-m", "eaid", *name.split(), "--help")
        (ours, other), most = paired_medians(command, bare, RUNS), 4 if name else 3
        yield Row(
            f"eaid {name} --help", "eaid", ours, "import typer", other, f"≤ {most:g} × the time", ours <= most * other
        )
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        for out in ("data.h5", "logs"):
            synth = ("synth", "-q", "--seed", "1", "--repeats", "3", "--noise-nm", "0.01", "-o", out)
            process(PYTHON, "-m", "eaid", *synth, cwd=where)()
        (where / "plain.py").write_text(PLAIN_SCRIPT)
        fit = ("-m", "eaid", "fit", "-q", "--force", "-o", "fit.json")
        imports = process(PYTHON, "-c", "import typer, numpy, scipy.optimize, h5py")
        ours, other = paired_medians(process(PYTHON, *fit, "data.h5", cwd=where), imports, RUNS)
        yield Row(
            "fit from data.h5, 10 levels × 3 repeats", "eaid fit data.h5", ours,
            "import typer, numpy, scipy.optimize, h5py", other, "≤ 3 × the time", ours <= 3 * other,
        )  # fmt: skip
        script = process(PYTHON, "plain.py", "logs", cwd=where)
        ours, other = paired_medians(process(PYTHON, *fit, "logs", cwd=where), script, RUNS)
        yield Row(
            "fit from 30 CSV files", "eaid fit logs/", ours, "pandas + curve_fit script", other, "≥ 2.5 × faster",
            other >= 2.5 * ours,
        )  # fmt: skip
