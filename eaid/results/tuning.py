"""What `tune` may be told: the options of gains.json, by their names, None where nothing was said.

Where nothing is said the paper's values are taken on a rig in % duty and N·m (Table IV, §V), and on any other rig what
its fit asks for (`eaid.control.defaults`).
"""

from typing import Literal

from eaid.errors import UsageError, unknown
from eaid.limits import check, check_all
from eaid.results.common import Number, Result

ALSO = ("frequency", "b-hat")
"""What a search may choose too: ω_n at the damping of the start, and B̂."""


class TuneOptions(Result, frozen=True):
    """Everything `tune` may be told; a field that is out of its limits raises `UsageError`."""

    bounds_levels: str | None = None
    """Levels that B_m, B_M are taken over, `30:100` or `30,40`; None: the fit's."""
    widen_bounds: bool = False
    """Take the far ends of the levels' 95 % intervals."""
    b_hat: Literal["pooled", "minimax"] | Number = "pooled"
    kp: Number | None = None
    """K_P [1/s²]"""
    kd: Number | None = None
    """K_D [1/s]"""
    natural_frequency: Number | None = None
    """In place of kp and kd [rad/s], with `damping`."""
    damping: Number | None = None
    q_max: Number | None = None
    """Q_M, largest slope of the reference [output/s]."""
    phi: Literal["data"] | Number | None = None
    """φ in the reading's own number, or `data`: what model and logs show."""
    epsilon: Number | None = None
    gamma: Number | None = None
    p_scale: Number = 5.0
    """P = p·I"""
    rho: Literal["paper", "textbook"] = "paper"
    """Reading of Eq. (15)."""
    alpha: Literal["formula", "reached"] = "formula"
    """The α that ρ is made with."""
    pi_overshoot: Number | None = None
    """[%]"""
    pi_settling: Number | None = None
    """2 % band [s]"""
    pi_gains: tuple[Number, Number] | None = None
    """K_P [input/output], K_I [input/(output·s)]"""
    anti_windup: Literal["conditional", "back-calculation"] = "conditional"
    duty_limits: tuple[Number, Number] | None = None
    """Range of the actuator, in the input's unit."""
    rate_hz: Number | None = None
    pwm_hz: Number | None = None
    """0: not latched."""
    optimize: bool = False
    optimize_for: Literal["tracking", "stiffness"] = "tracking"
    """tracking: the least RMS error. stiffness: the stiffest passive wall on a limb, reported against that error."""
    optimize_also: tuple[str, ...] = ()
    plants: int | None = None
    """Plants drawn for the search; None: 16."""
    noise_nm: Number | None = None
    """Torque noise of the search; None: what the logs show."""
    chatter_limit: Number | None = None
    """Most mean |Δu| per sample in the search; None: that of the start."""
    evaluations: int | None = None
    """Candidates of the search after the first scatter; None: 160."""
    allow_unidentified: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        _one_of("rho", self.rho, ("paper", "textbook"))
        _one_of("alpha", self.alpha, ("formula", "reached"))
        _one_of("anti_windup", self.anti_windup, ("conditional", "back-calculation"))
        _one_of("optimize_for", self.optimize_for, ("tracking", "stiffness"))
        for name in self.optimize_also:
            _one_of("optimize_also", name, ALSO)
        check_all(
            kp=self.kp, kd=self.kd, natural_frequency=self.natural_frequency, damping=self.damping, q_max=self.q_max,
            phi=None if self.phi == "data" else _number("phi", self.phi), epsilon=self.epsilon, gamma=self.gamma,
            p_scale=self.p_scale, pi_overshoot=self.pi_overshoot, pi_settling=self.pi_settling, rate_hz=self.rate_hz,
            pwm_hz=self.pwm_hz, plants=self.plants, noise_nm=self.noise_nm, chatter_limit=self.chatter_limit,
            evaluations=self.evaluations, seed=self.seed,
            b_hat=None if self.b_hat in ("pooled", "minimax") else _number("b_hat", self.b_hat),
        )  # fmt: skip
        for name, pair in (("pi_gains", self.pi_gains), ("duty_limits", self.duty_limits)):
            for value in pair or ():
                check(name, value)
        if self.duty_limits is not None and not self.duty_limits[0] < self.duty_limits[1]:
            low, high = self.duty_limits
            raise UsageError(f"«duty_limits» {low:g},{high:g}: must rise from 0 or above")
        self._check_pairs()

    def _check_pairs(self) -> None:
        by_frequency = self.natural_frequency is not None or self.damping is not None
        if by_frequency and (self.kp is not None or self.kd is not None):
            raise UsageError("give either «kp» and «kd», or «natural_frequency» and «damping», not both")
        if (self.natural_frequency is None) != (self.damping is None):
            raise UsageError("«natural_frequency» and «damping» belong together: give both")
        if (self.pi_overshoot is None) != (self.pi_settling is None):
            raise UsageError("«pi_overshoot» and «pi_settling» belong together: give both or neither")
        if self.pi_gains is not None and self.pi_overshoot is not None:
            raise UsageError("give either «pi_gains» or «pi_overshoot» with «pi_settling», not both")
        search = {name: getattr(self, name) for name in ("plants", "noise_nm", "chatter_limit", "evaluations")}
        idle = [f"«{name}»" for name, value in search.items() if value is not None]
        if idle and not self.searches:
            raise UsageError(f"{idle[0]}: does nothing without «optimize»; give both or neither")

    @property
    def searches(self) -> bool:
        """Whether gains are searched for."""
        return self.optimize or bool(self.optimize_also) or self.optimize_for != "tracking"


def _one_of(name: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise UsageError(unknown(f"«{name}»", value, known))


def _number(name: str, value: object) -> float | None:
    if value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
        return value
    words = {"phi": "data", "b_hat": "pooled, minimax"}[name]
    raise UsageError(f"«{name}» {value}: must be {words} or a number")
