"""How stiff a wall: the damping that a wall asks of the limb over frequency, and the stiffest walls over B_v."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.report import style
from eaid.report.results import Given
from eaid.report.rig import controller_name
from eaid.report.style import Ready, caption
from eaid.report.tables.table import number
from eaid.results.coupling import Coupling

SHOWN = ("open-loop", "pi", "rc-no-rate", "rc")


def walls_ready(couplings: Sequence[Given[Coupling]]) -> Ready | None:
    """How stiff a virtual wall each loop may render."""
    if not couplings or not couplings[0].result.walls:
        return None
    first = couplings[0].result
    at = middle_torque(first)
    shown = [wall for wall in first.walls if wall.torque_nm == at and wall.loop in SHOWN]
    passive = [f"{controller_name(wall.loop)} {number(wall.K_passive, 3)}" for wall in shown]
    return Ready(partial(walls, first), caption("walls", at=at, unit=first.output_unit, walls=passive))


def middle_torque(coupling: Coupling) -> float:
    """The torque of those held that is drawn: the middle one."""
    torques = sorted({wall.torque_nm for wall in coupling.walls})
    return torques[len(torques) // 2]


def walls(coupling: Coupling) -> Figure:
    """−Im G/ω with its maximum, and the region of K and B_v, both around the middle torque."""
    figure, (needed, region) = style.page(3.0, columns=2)
    at = middle_torque(coupling)
    for k, name in enumerate(SHOWN):
        colour = f"C{k}"
        for curve in coupling.curves:
            if (curve.loop, curve.torque_nm) == (name, at):
                f, asked = np.array(curve.frequency_hz), np.array(curve.needed_s)
                up = asked > 0
                needed.plot(f[up], asked[up], color=colour, label=controller_name(name))
                if up.any():
                    most = int(np.argmax(asked))
                    needed.plot(f[most], asked[most], "o", color=colour, markersize=4)
        for one in coupling.regions:
            if (one.loop, one.torque_nm) == (name, at):
                damping = [point.virtual_damping for point in one.points]
                for key, line in (("K_passive", "-"), ("K_stable", "--")):
                    held = [getattr(point, key) or np.nan for point in one.points]
                    region.plot(damping, held, line, color=colour)
    needed.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel="damping asked for per stiffness (s)")
    region.set(yscale="log", xlabel="virtual damping (N·m·s/rad)", ylabel="stiffness (N·m/rad)")
    region.plot([], [], "-", color="0.3", label="passive")
    region.plot([], [], "--", color="0.3", label="stable on this limb")
    for mark, panel in zip("ab", (needed, region), strict=True):
        style.letter(panel, mark)
    style.legend_above(needed, columns=2)
    style.legend_above(region, columns=2)
    return figure
