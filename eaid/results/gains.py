"""gains.json as types: the linear model, robust-control and PI gains, the guarantee, margins, what was replayed.

Units are the rig's: `input_unit` for duties, `output_unit` for torques; `_nm` and `_pct` in a key say what they are on
the paper's rig.
"""

from fractions import Fraction
from functools import cached_property
from typing import Annotated, ClassVar

import msgspec

from eaid.errors import UsageError
from eaid.findings import Finding, finding, sentences
from eaid.options import TuneOptions
from eaid.plant.linear import LinearPlant
from eaid.results import codec
from eaid.results.common import Input, Inputs, Made, Number, Positive, Result
from eaid.shown import Plotted, pandas


class RhoLine(Result, frozen=True):
    """ρ(ξ) = constant + slope ‖ξ‖ [N·m/s]."""

    constant: Number
    slope: Number


class Rho(RhoLine, frozen=True):
    """The same in the chosen reading, and what Eq. (15) needs with the α reached."""

    convention: str = "paper"
    needed: RhoLine | None = None


# Samples in the common period of samples and latches; of two rates without a short one the nearest
LARGEST_DIVISOR = 100


class Timing(Result, frozen=True, dict=True):
    """Rate of the controller, and the PWM that latches the duty; None: it takes effect at once."""

    rate_hz: Positive = 1000.0
    pwm_hz: Positive | None = None
    delay_samples: Annotated[float, msgspec.Meta(ge=0, le=1e15)] = 0.0
    """Dead time of the plant, in samples or parts of one."""

    @property
    def step_s(self) -> float:
        """Control interval [s]."""
        return 1 / self.rate_hz

    @property
    def delay_s(self) -> float:
        """Dead time [s]."""
        return self.delay_samples / self.rate_hz

    @cached_property
    def pattern(self) -> tuple[int, int]:
        """Samples and latches in their common period."""
        if self.pwm_hz is None:
            return 1, 1
        samples = self.rate_hz / self.pwm_hz
        if not 1 / 20.5 <= samples <= 100.5:
            raise UsageError(
                f"a PWM of {self.pwm_hz:g} Hz under control at {self.rate_hz:g} Hz is outside what margins are worked "
                "out for (0.05 to 100 samples a period); take rates nearer to each other"
            )
        ratio = Fraction(samples).limit_denominator(max(1, min(20, int(LARGEST_DIVISOR / samples))))
        return ratio.numerator, ratio.denominator

    @property
    def hold_s(self) -> float:
        """Time that a duty acts [s]."""
        samples, latches = self.pattern
        return samples / latches / self.rate_hz

    def words(self) -> str:
        """At what rate, latched how and how late the loop runs."""
        latched = "" if self.pwm_hz is None else f" with the duty latched at {self.pwm_hz:g} Hz"
        late = f" behind a dead time of {self.delay_s:.3g} s" if self.delay_samples else ""
        return f"at {self.rate_hz:g} Hz{latched}{late}"


class Margin(Result, frozen=True):
    """Margins of one loop."""

    stable: bool | None = None
    gain_db: Number | None = None
    phase_deg: Number | None = None
    crossover_hz: Number | None = None


class MarginPoint(Result, frozen=True):
    """Margins of each loop around one held duty."""

    duty_pct: Number
    torque_nm: Number | None = None
    loops: dict[str, Margin] = {}
    """By the controller's name."""
    falling: bool = False
    """With the time constants of falls between levels, where those have their own."""


class Margins(Result, frozen=True):
    """Margins of each loop, sampled and latched as `timing` says."""

    timing: Timing = Timing()
    points: tuple[MarginPoint, ...] = ()
    worst: dict[str, Margin] = {}
    """The least of each margin over all points, by the controller's name."""


class Tracking(Result, frozen=True):
    """Errors of one replay: reference − true output, from `counted_from_s` on."""

    max_abs_error_nm: Number | None = None
    rms_error_nm: Number | None = None
    mean_abs_error_nm: Number | None = None
    mean_abs_duty_step_pct: Number | None = None
    saturated_fraction: Number | None = None


class Compared(Tracking, frozen=True):
    """One controller on the reference, with its gains and its least margins."""

    K_P: Number | None = None
    """[input/output]; of RC its slope inside the layer."""
    K_I: Number | None = None
    """[input/(output·s)]"""
    stable: bool | None = None
    gain_db: Number | None = None
    phase_deg: Number | None = None


class Replayed(Result, frozen=True):
    """Controllers on the standard reference, compared at equal margins too."""

    ROWS: ClassVar = ("rc", "equal_pi_feedforward", "equal_pi", "pi", "paper_pi")
    """In the order in which they are shown."""
    reference: str = ""
    slope_nm_s: Number | None = None
    counted_from_s: Number | None = None
    rc: Compared | None = None
    pi: Compared | None = None
    """The PI that was designed."""
    equal_pi: Compared | None = None
    """The PI whose loop is RC's inside the layer: its slopes, less what the feedforward takes."""
    equal_pi_feedforward: Compared | None = None
    """The same with RC's feedforward."""
    paper_pi: Compared | None = None
    """The paper's PI, 21 and 360, where the rig is the paper's and its own PI is another."""
    others: dict[str, Compared] = {}
    """Further controllers of the table, by name."""

    @property
    def rows(self) -> dict[str, Compared]:
        """All that were compared, by name."""
        every = {name: getattr(self, name) for name in self.ROWS}
        return {name: one for name, one in every.items() if one is not None} | self.others


class Condition(Result, frozen=True):
    """One thing that the guarantee needs, and what is there."""

    name: str
    """rho, phi, range (of the torque that φ was seen over), Q_M, duty-limit, duty-floor (where what is needed may not
    lie below what there is), sampling; falls where they differ from rises (B of theirs, and the end of its range that
    this comes nearest to), dead-time where the steps show one, sampled-error where sampling leaves more than the
    bound."""
    holds: bool | None = None
    """None: nothing here can tell."""
    needed: Number | None = None
    available: Number | None = None
    unit: str = ""

    @property
    def lack(self) -> str:
        """` 18 of 32 %`; empty where it has no numbers."""
        known = self.needed is not None and self.available is not None
        return f" {self.available:.3g} of {self.needed:.3g} {self.unit}".rstrip() if known else ""


class Guarantee(Result, frozen=True):
    """One verdict: whether the Lyapunov guarantee holds on this rig, with a row for each thing it needs.

    True of it means that it is known to hold.

    Examples
    --------
    >>> verdict = Guarantee(False, (Condition("phi", False, 32.0, 18.0, "%"), Condition("rho", True)))
    >>> verdict.missing, bool(verdict), bool(Guarantee(None)), bool(Guarantee(True))
    (('phi',), False, False, True)
    >>> verdict, Guarantee(True)
    (NO: phi 18 of 32 %, yes)
    """

    holds: bool | None = None
    """None: not known."""
    conditions: tuple[Condition, ...] = ()

    def __bool__(self) -> bool:
        return self.holds is True

    def __repr__(self) -> str:
        """`NO: rho 6.15 of 20.3 N/s; …`: of each condition that fails what there is and what it takes."""
        if self.holds is not False:
            return "yes" if self.holds else "not known"
        rows = [one for one in self.conditions if one.holds is False]
        return f"NO: {'; '.join(f'{one.name}{one.lack}' for one in rows)}"

    @property
    def missing(self) -> tuple[str, ...]:
        """The conditions that do not hold."""
        return tuple(one.name for one in self.conditions if one.holds is False)


class EqualPI(Result, frozen=True):
    """The PI of equal slope inside the boundary layer."""

    K_P: Number | None = None
    K_I: Number | None = None


class Robust(Result, frozen=True):
    """Robust-control gains, Eqs. (10)–(16)."""

    SHOWN: ClassVar = {"K_P": "K_P", "K_D": "K_D", "B_hat": "B̂", "phi": "φ"}
    """Its numbers in a table of controllers, and how they are written."""
    K_P: Number
    """[1/s²]"""
    K_D: Number
    """[1/s]"""
    B_hat: Positive
    """[input·s/output]"""
    rho: Rho
    epsilon: Positive
    gamma: Positive
    Q: tuple[tuple[Number, Number], tuple[Number, Number]]
    P: tuple[tuple[Number, Number], tuple[Number, Number]] | None = None
    B_m: Number | None = None
    B_M: Number | None = None
    alpha: Number | None = None
    alpha_reached: Number | None = None
    guaranteed: bool | None = None
    """The verdict of `Gains.guarantee`; there is no other."""
    rho_covers: bool | None = None
    """One of its conditions: ρ meets Eq. (15) with the α reached, φ and Q_M taken as true."""
    phi: Number | None = None
    phi_honest_pct: Number | None = None
    """What φ means in the input's unit."""
    phi_holds: bool | None = None
    Q_M: Number | None = None
    """Bound on the reference's slope."""
    equal_pi: EqualPI | None = None
    ultimate_bound_nm: Number | None = None
    """Largest error in the end that the argument allows, where the guarantee holds; from rest to there it is silent."""


class AskedPI(Result, frozen=True):
    """What the PI was designed for."""

    overshoot_pct: Number | None = None
    settling_s: Number | None = None


class PI(Result, frozen=True):
    """PI gains, and what they reach on the linear model."""

    SHOWN: ClassVar = {"K_P": "K_P", "K_I": "K_I"}
    K_P: Number
    """[input/output]"""
    K_I: Number
    """[input/(output·s)]"""
    overshoot_pct: Number | None = None
    settling_s: Number | None = None
    asked: AskedPI | None = None


class Gains(Plotted, codec.Saved, Made, frozen=True):
    """Gains of both controllers, and what is known of them.

    Examples
    --------
    >>> import eaid
    >>> gains = eaid.tune_rc(eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)))
    >>> gains
    <Gains: rc  K_P 4.5, K_D 3, B̂ 9.223>
    >>> gains.guarantee.holds, gains.guarantee.missing[0]
    (False, 'rho')
    """

    FILE: ClassVar[str] = "gains"
    model: LinearPlant
    rc: Robust | None = None
    pi: PI | None = None
    controllers: dict[str, dict[str, Number]] = {}
    """Gains of the others, by name: what their step takes beyond the model and the limits."""
    inputs: Inputs = {}
    options: TuneOptions | None = None
    input_unit: str = "%"
    output_unit: str = "N·m"
    duty_limits_pct: tuple[Number, Number] = (0.0, 100.0)
    """The actuator's range, in the input's unit."""
    guarantee: Guarantee | None = None
    margins: Margins | None = None
    replayed: Replayed | None = None
    not_usable: str | None = None
    """Why the fit must not be used that they were made from all the same; None: it may be."""

    def __post_init__(self) -> None:
        low, high = self.duty_limits_pct
        if not low < high:
            raise ValueError(f"duty_limits_pct {low:g} to {high:g}, which has to rise")
        if self.rc is not None and self.guarantee is not None:  # one verdict, whatever a file says beside it
            msgspec.structs.force_setattr(self, "rc", msgspec.structs.replace(self.rc, guaranteed=self.guarantee.holds))

    @property
    def params(self) -> "pandas.Series[float]":
        """All gains, indexed by (law, gain)."""
        laws = {
            name: law if isinstance(law, dict) else {key: getattr(law, key) for key in law.SHOWN}
            for name, law in self.controllers_by_name.items()
        }
        known = {(name, key): value for name, law in laws.items() for key, value in law.items() if value is not None}
        names = pandas.MultiIndex.from_tuples(known, names=["law", "gain"])
        return pandas.Series(list(known.values()), index=names, name="value", dtype=float)

    @property
    def laws(self) -> dict[str, Robust | PI]:
        """RC and PI by name."""
        every = {"rc": self.rc, "pi": self.pi}
        return {name: law for name, law in every.items() if law is not None}

    @property
    def controllers_by_name(self) -> dict[str, "Robust | PI | dict[str, float]"]:
        """All controllers: RC, PI, and the others."""
        return {**self.laws, **self.controllers}

    @property
    def refused(self) -> dict[str, str]:
        """Why a controller has no gains, by name."""
        return {one.subject: str(one.values["why"]) for one in self.findings if one.code == "controller-refused"}

    def summary(self) -> str:
        """Gains, the one verdict on the guarantee, and the gravest findings."""
        lines, least = [], self.margins.worst if self.margins is not None else {}
        if self.rc is not None:
            lines.append(f"rc  K_P {self.rc.K_P:g}, K_D {self.rc.K_D:g}, B̂ {self.rc.B_hat:.4g}")
        if self.pi is not None:
            lines.append(f"pi  K_P {self.pi.K_P:.4g}, K_I {self.pi.K_I:.4g}")
        for name, one in ((name, one) for name, one in least.items() if None not in (one.gain_db, one.phase_deg)):
            lines.append(f"least margins of {name}: {one.gain_db:.3g} dB, {one.phase_deg:.3g}°")
        if self.guarantee is not None:
            lines.append(f"guarantee: {self.guarantee}")
        return "\n".join([*lines, *sentences(self.findings[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """One row a law: its gains, in input per output."""
        keys = ("K_P", "K_D", "K_I")
        rows = {name: {key: getattr(law, key, None) for key in keys} for name, law in self.laws.items()}
        return pandas.DataFrame.from_dict(rows, orient="index", dtype=float)


def of_another_fit(gains: Gains | None, sha256: str) -> tuple[Finding, ...]:
    """Said where gains are used with a fit, of that checksum, which is not the one they were made from."""
    made = None if gains is None else gains.inputs.get("fit")
    if not isinstance(made, Input) or not made.sha256 or made.sha256 == sha256:
        return ()
    return (finding("gains-of-another-fit", "gains", path=made.path),)
