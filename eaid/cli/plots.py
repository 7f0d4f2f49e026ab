"""Little plots in the terminal, of characters only: the levels with the model, and what controllers did."""

import shutil
import sys
from collections.abc import Mapping

import numpy as np
import plotext

from eaid.arrays import Array
from eaid.cli import console
from eaid.models import friction
from eaid.results.fit import Fit
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

HEIGHT = 20
WIDEST = 120
POINTS = 14
"""Measured points drawn of each level."""
ASCII = str.maketrans("┌┐└┘─│┤├┬┴┼·−…°", "++++-|++++++.-.'"[:15])
"""Letters for a terminal that knows no others."""


def levels(fit: Fit, steps: StepSet) -> None:
    """The mean of each level, and the model's curve through it."""
    dots, curves = [], []
    for level in steps.levels:
        end = float(level.time_s[-1])
        at = np.linspace(0, end, 4 * WIDEST)
        picked = np.unique(np.linspace(0, len(level.time_s) - 1, POINTS).astype(int))
        dots.append((level.time_s[picked], level.mean[picked]))
        if fit.nonlinear is not None:
            curves.append((at, fit.predict(level.level, at.tolist()).to_numpy()[:, 0]))
        elif fit.friction is not None:
            curves += [(at, friction.step_response(row.curve, at)) for row in fit.friction.levels
                       if row.level == level.level and row.from_ == 0]  # fmt: skip
    model = "nonlinear model" if fit.nonlinear is not None else "curve of each level"
    title = f"output [{fit.data.output_unit}] over time since the step [s]: o measured, · {model}"
    _draw(title, {"·": _joined(curves), "o": _joined(dots)})


def replay(made: Replay) -> None:
    """The reference and the output of each controller over time."""
    groups = {name: one.columns for name, one in made.records.items() if one.role != "recorded-loop"}
    if not groups:
        return
    first = next(iter(groups.values()))
    marks = {"·": (first["time_s"], first["reference_nm"])}
    told = ["· recorded" if made.head.scenario == "log" else "· reference"]
    for name, columns in list(groups.items())[:5]:
        letter = next(c for c in f"{name}abcdefgh" if c.isalnum() and c not in marks)
        every = slice(None, None, max(1, len(columns["time_s"]) // (2 * WIDEST)))
        marks[letter] = (columns["time_s"][every], columns["torque_nm"][every])
        told.append(f"{letter} {name}")
        if made.head.scenario == "log":
            break  # each run has a time of its own
    _draw(f"output [{made.head.output_unit}] over time [s]: {', '.join(told)}", marks)


def _joined(pairs: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    empty = np.empty(0)
    return np.concatenate([empty, *(x for x, _ in pairs)]), np.concatenate([empty, *(y for _, y in pairs)])


def _draw(title: str, marks: Mapping[str, tuple[Array, Array]]) -> None:
    """Points by their marks, the later ones above."""
    width = min(shutil.get_terminal_size().columns - 2, WIDEST) if sys.stdout.isatty() else 78
    figure = plotext.figure
    figure.clear()
    figure.plot_size(width, HEIGHT)
    for mark, (x, y) in marks.items():
        known = np.isfinite(x) & np.isfinite(y)
        if known.any():
            figure.draw(figure.signal(x[known].tolist(), y[known].tolist(), marker=mark))
    lines = [title, *plotext.uncolorize(str(figure.build())).splitlines()]
    plain = (sys.stdout.encoding or "ascii").lower().replace("-", "") not in ("utf8", "utf16", "utf32")
    for line in lines:
        console.line((line.translate(ASCII) if plain else line).rstrip())
