"""Fig. 6: torque while the input is held and after it is released; DC drive loses torque and leaves some behind."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.ready import Ready, caption
from eaid.report.rig import level_text, quantity
from eaid.report.thin import thinned
from eaid.steps.noise import block_means
from eaid.steps.stepset import StepSet


@dataclass(frozen=True, eq=False)
class Held:
    """Mean of a level's repeats, held and then released; time from the step, idle output subtracted."""

    level: float
    time_s: Array
    torque: Array
    release_s: float

    @property
    def lost_pct(self) -> float:
        """Torque lost from peak to release [% of the peak], by means of twentieths."""
        means = block_means(self.torque[self.time_s <= self.release_s])
        return 100 * max(0.0, 1 - float(means[-1] / means.max())) if means.max() > 0 else 0.0

    @property
    def left_pct(self) -> float:
        """Torque left at the end of the log [% of the torque when held], by means of twentieths."""
        held = float(block_means(self.torque[self.time_s <= self.release_s])[-1])
        left = float(block_means(self.torque[self.time_s > self.release_s])[-1])
        return 100 * left / held if held > 0 else 0.0


def hold_ready(data: StepSet) -> Ready | None:
    """Fig. 6, where the dataset holds releases."""
    levels, unit = held_levels(data), data.input_unit
    if not levels:
        return None
    draw = partial(hold_and_release, levels, unit, data.output_unit)
    return Ready(draw, caption("held", top=levels[0], unit=unit))


def held_levels(data: StepSet) -> list[Held]:
    """Levels whose rise and release were both recorded: the highest, the middle and the lowest of them."""
    rising = {level.level: level for level in data.levels}
    found = []
    for release in data.releases:
        if (step := rising.get(release.level)) is None:
            continue
        dt = float(step.time_s[-1] - step.time_s[0]) / max(len(step.time_s) - 1, 1)
        end = float(step.time_s[-1]) + dt
        time = np.concatenate([step.time_s, end + release.time_s])
        found.append(Held(release.level, time, np.concatenate([step.mean, release.mean]), end - dt / 2))
    if len(found) <= 3:
        return found[::-1]
    return [found[-1], found[len(found) // 2], found[0]]


def hold_and_release(levels: Sequence[Held], input_unit: str, output_unit: str) -> Figure:
    """Output over time, the held stretch shaded; the shares lost while held and left after release are written."""
    figure, (axes,) = style.column(2.7)
    looks = [(style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-.")]
    axes.axvspan(0, levels[0].release_s, color="#E8E8E8", lw=0)
    for run, (colour, line) in zip(levels, looks, strict=False):
        label = f"{level_text(run.level, input_unit)}: lost {run.lost_pct:.1f} %, left {run.left_pct:.1f} %"
        label = label.replace("-", "−")
        t, y = thinned(run.time_s, run.torque, 1500)
        axes.plot(t, y, color=colour, linestyle=line, linewidth=0.9, label=label)
    axes.set(xlabel="Time since the step (s)", ylabel=quantity(output_unit), xlim=(0, float(levels[0].time_s[-1])))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.12 * (high - low))  # the words stand above every curve
    for text, at in (("input on", levels[0].release_s / 2), ("off", (levels[0].release_s + levels[0].time_s[-1]) / 2)):
        axes.annotate(text, (float(at), 0.985), xycoords=("data", "axes fraction"), ha="center", va="top")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure
