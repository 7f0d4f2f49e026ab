"""Fig. 6: torque while the input is held and after it is released; DC drive loses torque and leaves some behind."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.logs.run import Run
from eaid.report import style
from eaid.report.thin import thinned


@dataclass(frozen=True, eq=False)
class Held:
    """One recording with its input held and then released; time from the step."""

    name: str
    time_s: Array
    torque_nm: Array
    """Idle torque subtracted."""
    release_s: float


def held_runs(runs: tuple[Run, ...], most: int = 3) -> list[Held]:
    """Runs that go on for a while after their input returned to rest, the highest inputs first."""
    found: list[tuple[float, Held]] = []
    for run in runs:
        if run.edge == "falling" or not np.isfinite(run.input).all():
            continue
        top = float(np.max(run.input))
        active = run.input > 0.5 * top
        if top <= 0 or not active.any():
            continue
        first = int(np.argmax(active))
        last = len(active) - 1 - int(np.argmax(active[::-1]))
        after_s = float(run.time_s[-1] - run.time_s[last])
        if first == 0 or after_s < 0.05 * float(run.time_s[last] - run.time_s[first]) or not active[first:last].all():
            continue
        idle = run.baseline if run.baseline is not None else float(np.mean(run.output[:first]))
        start = float(run.time_s[first])
        found.append(
            (top, Held(run.name, run.time_s - start, run.output - idle, float(run.time_s[last]) - start))
        )
    found.sort(key=lambda item: (-item[0], item[1].name))
    return [held for _, held in found[:most]]


def hold_and_release(held: list[Held]) -> Figure:
    """Torque over time [N·m], the held stretch shaded; the share lost while held and left after release is written."""
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.3)
    looks = [(style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-.")]
    axes.axvspan(0, held[0].release_s, color="#E8E8E8", lw=0, label="input on")
    for run, (colour, line) in zip(held, looks, strict=False):
        lost, left = lost_and_left(run)
        t, y = thinned(run.time_s, run.torque_nm, 1500)
        axes.plot(
            t, y, color=colour, linestyle=line, linewidth=0.9,
            label=f"{run.name}: lost {lost:.0f} %, left {left:.0f} %",
        )  # fmt: skip
    axes.set(xlabel="Time since the step (s)", ylabel="Torque (N·m)")
    axes.set_xlim(min(float(run.time_s[0]) for run in held), None)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.2)
    return figure


def lost_and_left(run: Held) -> tuple[float, float]:
    """Torque lost from peak to release, and torque left at the end of the log [% of the peak]; means of 1 % stretches."""
    on = run.torque_nm[(run.time_s >= 0) & (run.time_s <= run.release_s)]
    off = run.torque_nm[run.time_s > run.release_s]
    width = max(1, len(on) // 100)
    smooth = np.convolve(on, np.ones(width) / width, mode="valid")
    peak = float(smooth.max())
    if peak <= 0:
        return 0.0, 0.0
    tail = off[-max(1, len(off) // 20) :]
    return 100 * (1 - float(smooth[-1]) / peak), 100 * float(np.mean(tail)) / peak
