"""One torque loop on a limb: the stiffest walls that it renders at a torque, and its region over damping."""

import math
from dataclasses import dataclass

import numpy as np

from eaid.control.operating import known
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.control.timing import Timing
from eaid.coupling.linearised import Point, linearised, operating_point, step_of
from eaid.coupling.motion import Drive
from eaid.coupling.sampled import Channel, Coupled, Limb
from eaid.coupling.stiffness import needed_damping, passive_stiffness, stable_stiffness
from eaid.errors import GainsError
from eaid.models.parameters import Nonlinear
from eaid.results import coupling as parts

SHOWN_POINTS = 200
"""Frequencies of a stored curve."""
REGION_POINTS = 9


@dataclass(frozen=True)
class Loops:
    """The gains of the torque loops, and the limb and the timing that they work with."""

    rc: RCGains | None
    pi: PIGains | None
    limb: Limb
    timing: Timing
    virtual_damping: float = 0.0

    def has_gains(self, loop: str) -> bool:
        """Whether a loop can be worked out."""
        return self.pi is not None if loop == "pi" else self.rc is not None or loop not in ("rc", "rc-no-rate")

    def around(self, loop: str, plant: Nonlinear, point: Point, weight: float = 1.0) -> tuple[Channel, Drive]:
        """One clutch around a point, linear and as it is; GainsError where it is unstable without a wall."""
        step, start = step_of(loop, plant, point, self.rc, self.pi, self.timing.step_s)
        channel = Channel(point, linearised(step, start, point), weight)
        radius = float(np.abs(Coupled([channel], Limb(), self.timing).poles(0.0)).max())
        if radius > 1 + 1e-9:
            raise GainsError(
                f"the loop {loop} is unstable at {point.torque_nm:g} without any wall (spectral radius {radius:.4f}); "
                "no stiffness can be rendered on it, choose other gains or timing"
            )
        return channel, Drive(plant, point, step, start)

    def stable_wall(self, loop: str, plant: Nonlinear, torque_nm: float) -> float:
        """The stiffest wall that one loop keeps stable around one torque [N·m/rad], linear and sampled."""
        channel, _ = self.around(loop, plant, operating_point(plant, torque_nm))
        return stable_stiffness(Coupled([channel], self.limb, self.timing))

    def wall(
        self, loop: str, channels: list[Channel], torque: float, duty: float | None
    ) -> tuple[parts.Wall, parts.Curve]:
        """The stiffest walls at one torque, and what they ask of the limb over frequency."""
        needed, coupled = needed_damping(channels, self.timing), Coupled(channels, self.limb, self.timing)
        K_passive, limit = passive_stiffness(needed, self.limb.damping_nms, self.virtual_damping)
        K_stable = stable_stiffness(coupled, self.virtual_damping)
        lost = _lost_hz(coupled, K_stable, self.virtual_damping)
        limit_hz = 0.0 if limit <= needed.omega[0] else limit / (2 * math.pi)  # the slowest looked at stands for rest
        chosen = np.unique(np.linspace(0, len(needed.omega) - 1, SHOWN_POINTS).astype(int))
        wall = parts.Wall(loop, torque, duty, known(K_passive), limit_hz, known(K_stable), lost)
        curve = parts.Curve(
            loop, torque,
            tuple((needed.omega[chosen] / (2 * math.pi)).tolist()),
            tuple(needed.damping(1.0)[chosen].tolist()),
            tuple((20 * np.log10(np.abs(needed.response[chosen]))).tolist()),
        )  # fmt: skip
        return wall, curve

    def region(self, loop: str, channels: list[Channel], torque: float) -> parts.Region:
        """K over B_v, from 0 to twice the limb's damping."""
        needed, coupled = needed_damping(channels, self.timing), Coupled(channels, self.limb, self.timing)
        rows = [
            (damping, passive_stiffness(needed, self.limb.damping_nms, damping)[0], stable_stiffness(coupled, damping))
            for damping in np.linspace(0.0, 2 * self.limb.damping_nms, REGION_POINTS).tolist()
        ]
        return parts.Region(loop, torque, tuple(parts.RegionPoint(b, known(p), known(s)) for b, p, s in rows))


def _lost_hz(coupled: Coupled, stiffness: float, damping: float) -> float | None:
    if not 0 < stiffness < math.inf:
        return None
    poles = coupled.poles(stiffness, damping)
    worst = poles[int(np.argmax(np.abs(poles)))]
    return float(abs(np.angle(worst)) * coupled.timing.rate_hz / coupled.timing.pattern[0] / (2 * math.pi))
