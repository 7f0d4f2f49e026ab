"""Every option of eaid, declared once; `eaid.declared` says how, and derives flags, keywords, limits and refusals.

A default of None is settled where the option is used: those of gains in `eaid.control.defaults`.
"""

import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import msgspec

from eaid.apparatus import Apparatus
from eaid.declared import Options, any_text, as_typed, option, pairs, spaced
from eaid.errors import UsageError, unknown

Pair = tuple[float, float]
Numbers = tuple[float, ...]
OptionWords = tuple[str, ...]
ExperimentKind = Literal["clutch", "friction-force", "friction-speed"]
EXPERIMENTS: tuple[ExperimentKind, ...] = ("clutch", "friction-force", "friction-speed")
MODELS = ("friction", "nonlinear", "linear")
LAWS = ("pi", "rc", "pi-feedforward", "inverse", "plant")
LOOPS = ("open-loop", "pi", "rc-no-rate", "rc")
TRACKED = ("multisine", "steps", "sweep")
SCENARIOS = (*TRACKED, "rehab")
CONTROLLERS = ("rc", "pi", "pi-feedforward", "smith", "open-loop", "inverse")
ROLES = ("time", "input", "output", "reference", "position")
EXCITATIONS = ("random", "staircase", "chirp", "closed-loop")

READING, STEPS, MODEL, RECORDED = "Reading logs", "Finding steps", "Model", "Logs fitted as recorded"
ROBUST, OF_PI, RIG, ADVANCED = "Robust controller", "PI controller", "Rig", "Advanced"
WHAT, MORE, REHAB, CHANCE = "What is replayed", "More plants", "Rehabilitation", "Chance"
LIMB, LOOP = "The limb and the wall", "The loop as it runs"
LOGS, WHEN, HOW, INPUTS = "What is recorded", "Times", "Disturbances", "Other inputs than steps"
FIGURES, SESSIONS = "Figures", "Sessions"

# Limits of options that are alike
RATE: dict[str, Any] = {"least": 1e-3, "most": 1e5}
ANY: dict[str, Any] = {"least": -1e12, "most": 1e12}
POSITIVE: dict[str, Any] = {"least": 1e-15, "most": 1e15}
# What of a shape only some inputs have
USED_BY = {
    "duty": ("random", "staircase", "chirp"), "levels": ("random", "staircase", "closed-loop"), "rest_s": ("random",),
    "hold_s": ("random", "staircase", "closed-loop"),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Chance(Options):
    """Of everything that draws."""

    seed: int = option(0, "Of everything random; the same seed gives the same bytes.", CHANCE, least=0, most=2**53 - 1)


@dataclass(frozen=True, kw_only=True)
class Columns(Options):
    """Which columns of a log are which."""

    columns: Mapping[str, str] = option(
        {}, 'Column of each role, by name or number: time=Time,input=Volts,output="Load Cell".', READING,
        shown="ROLE=NAME,…",
    )  # fmt: skip
    units: Mapping[str, str] = option(
        {}, "Unit of a column: time=us,output=g; input=/255: 255 counts are the full scale.", READING,
        shown="ROLE=UNIT,…",
    )  # fmt: skip
    variable: str | None = option(
        None, "Table of a file with several: a MAT variable, an HDF5 path, a TDMS group.", READING, shown="NAME"
    )
    repair: bool = option(False, "Drop bad rows and spikes, up to 1 % of a log, and say how many.", READING)


@dataclass(frozen=True, kw_only=True)
class ReadOptions(Columns):
    """How logs are read."""

    name_pattern: str | None = option(
        None, "Level and repeat from file names, anywhere in them: '_V={level}_', 'run{repeat}'.", READING,
        shown="PATTERN",
    )  # fmt: skip
    where: Mapping[str, str] = option(
        {}, "Only logs whose names say so: f=1000 takes _f=1000_; more than once, all of them.", READING,
        shown="KEY=VALUE,…",
    )  # fmt: skip
    rate_hz: float | None = option(None, "Samples a second of logs without a time column [Hz].", READING, above=True)
    kind: ExperimentKind | None = option(None, "Experiment; by itself from the columns.", STEPS)
    levels: str | None = option(None, "Levels to keep: 30:100 or 30,40,90.", STEPS, levels=True)
    baseline: str = option(
        "auto", "Value before each step: its last rest, the first samples, none, a value, or a window in s to it.",
        STEPS, words="auto|first|none", read=any_text, shown="WORD|VALUE|FROM:TO",
    )  # fmt: skip
    rest: float = option(0.0, "Input at rest, in the unit of the levels, which are counted from it.", STEPS, **ANY)
    step_at: float | None = option(None, "Step instant, in seconds of the log.", STEPS, **ANY)
    until: float | None = option(None, "End of the active window, in seconds of the log.", STEPS, **ANY)
    apparatus: Apparatus | None = option(
        None, "The rig, where it is not the paper's: surfaces=1,inner_radius_m=0.03.", STEPS, shown="NAME=VALUE,…"
    )
    logs_as: str = option(
        "auto", "By what the input does, all as steps, or all as recorded.", RECORDED, words="auto|steps|recorded"
    )

    def agree(self) -> None:
        """Refuse names of no role and patterns without a field; settle the rig that is written as a text."""
        wrong = [role for role in (*self.columns, *self.units) if role not in ROLES]
        if wrong:
            raise UsageError(f"«columns» and «units» know {', '.join(ROLES[:-1])} and {ROLES[-1]}, not {wrong[0]}")
        if self.name_pattern is not None:
            held = re.findall(r"\{(level|repeat)\}", self.name_pattern)
            if not held:
                raise UsageError(f"«name_pattern» {self.name_pattern}: holds neither {{level}} nor {{repeat}}")
            if len(set(held)) < len(held):
                raise UsageError(f"«name_pattern» {self.name_pattern}: holds a field twice")
        object.__setattr__(self, "apparatus", apparatus_from(self.apparatus, self.kind))

    def stated(self) -> dict[str, str | float | bool]:
        """What was given, as texts where they are no numbers, so that it can be done again."""
        return {
            name: value if isinstance(value, float | bool) else as_typed(value) for name, value in self.given().items()
        }


def apparatus_from(text: str | Apparatus | None, kind: str | None) -> Apparatus | None:
    """The rig that `«apparatus»` describes; what it leaves out is the paper's. None where nothing is given."""
    if not text or isinstance(text, Apparatus):
        return text or None
    given, known = pairs("«apparatus»", text), [each.name for each in fields(Apparatus)]
    for name in given:
        if name not in known:
            raise UsageError(unknown("«apparatus»", name, known))
    try:
        return msgspec.convert({"surfaces": 1 if kind in EXPERIMENTS[1:] else 2, **given}, Apparatus, strict=False)
    except msgspec.ValidationError as fault:
        why = str(fault).replace("`", "").replace(" - at $.", ": ")
        raise UsageError(f"«apparatus» {text}: {why}") from None


def typed(given: Mapping[str, Any]) -> str:
    """Options as they are typed, their names in guillemets: `«step_at» 2 «repair»`."""
    words = []
    for name, value in given.items():
        text = as_typed(value).replace(",", ":") if name == "duty" else as_typed(value)
        words.append(f"«{name}»" + f" {shlex.quote(text)}" * (value is not True))
    return " ".join(words)


@dataclass(frozen=True, kw_only=True)
class FitOptions(Chance):
    """How steps and recorded logs are fitted."""

    model: OptionWords | None = option(None, "By itself all that the kind allows.", MODEL, words=MODELS)
    share: float | Literal["free"] = option(
        0.85, "C, share of the fast part, held or free.", MODEL, least=0, most=0.999, above=True
    )
    estimator: str = option("auto", "By the evidence, or all at once as in the paper.", MODEL, words="auto|joint")
    curve: str = option(
        "auto",
        "T_s of the input: the paper's cubic, a natural spline with knots at the quartiles of the inputs, or through "
        "the value of each level; auto: where the output levels off.",
        MODEL,
        words="auto|cubic|levels|spline",
    )
    ci: str = option("robust", "How 95 % intervals are found.", MODEL, words="robust|bootstrap|white|none")
    draws: int = option(300, "Refits of the bootstrap.", MODEL, least=1, most=100_000)
    hold_out: Numbers = option((), "Left out, to measure the error: 40,70.", MODEL, levels=True)
    loss: str = option("squares", "Huber for logs with spikes and drop-outs.", MODEL, words="squares|huber")
    duty: Pair | None = option(None, "Identified range of the input.", RECORDED, shown="LOW:HIGH", rises="<=")
    bounds_levels: str | None = option(None, "Levels of B_m and B_M: 30:100 or 30,40.", ADVANCED, levels=True)
    shape: str = option(
        "auto", "Of steps between levels; auto: by the evidence.", ADVANCED, words="auto|one|two|free|overshoot"
    )
    dead_time: float | Literal["auto"] = option(
        "auto", "Of each single step [s]; auto: by the evidence.", ADVANCED, least=0, most=1e4
    )

    @property
    def through(self) -> bool:
        """Whether T_s(u) is asked to go through the values of the levels."""
        return self.curve == "levels"

    @property
    def holds_curve(self) -> bool:
        """Whether T_s(u) is asked to be no polynomial."""
        return self.curve not in ("auto", "cubic")

    @property
    def held_share(self) -> float | None:
        """C where it is held, None where it is free."""
        return None if isinstance(self.share, str) else self.share

    @property
    def held_dead_time_s(self) -> float | None:
        """The dead time where it is given, None where the evidence decides."""
        return None if isinstance(self.dead_time, str) else self.dead_time


@dataclass(frozen=True, kw_only=True)
class TuneOptions(Chance):
    """How gains are designed; None: the paper's values on its rig (Table IV, §V), else what the fit asks for."""

    kp: float | None = option(None, "K_P [1/s²]; by itself 4.5.", ROBUST, **ANY)
    kd: float | None = option(None, "K_D [1/s]; by itself 3.", ROBUST, **ANY)
    natural_frequency: float | None = option(None, "ω_n [rad/s], in place of K_P and K_D.", ROBUST, **POSITIVE)
    damping: float | None = option(None, "Damping ratio, with the natural frequency.", ROBUST, **POSITIVE)
    b_hat: Literal["pooled", "minimax"] | float | None = option(
        None, "1/b0, the middle of B_m, B_M (by itself where 1/b0 > 2 B_m), or a value.", ROBUST, **ANY
    )
    q_max: float | None = option(None, "Q_M, largest slope of the reference; by itself 5 N·m/s.", ROBUST)
    phi: Literal["data"] | float | None = option(None, "By itself 0.05; data: by the model.", ROBUST)
    pi_gains: Pair | None = option(
        None, "Its gains; by itself designed from the fit, the paper's are 21,360.", OF_PI, shown="K_P,K_I", **ANY
    )
    pi_overshoot: float | None = option(None, "Or designed: overshoot on the linear model [%].", OF_PI, **ANY)
    pi_settling: float | None = option(None, "And settling time, 2 % band [s].", OF_PI, **ANY)
    duty_limits: Pair | None = option(None, "By itself 0,100 % or as identified.", RIG, shown="LOW,HIGH")
    rate_hz: float | None = option(None, "Control rate [Hz]; by itself 1000.", RIG, **RATE)
    pwm_hz: float | None = option(None, "Duty latched at [Hz]; 0: off; by itself the fit's, else 300.", RIG)
    epsilon: float | None = option(None, "ε, half width of the boundary layer; by itself 0.5.", ADVANCED, **POSITIVE)
    gamma: float | None = option(None, "γ, sharpness of the soft switch; by itself 50.", ADVANCED, **POSITIVE)
    p_scale: float = option(5.0, "p of P = p·I in the Lyapunov equation.", ADVANCED, **POSITIVE)
    rho: Literal["paper", "textbook"] = option("paper", "Eq. (15) read as B_M φ, or as φ/B_m.", ADVANCED)
    anyway: bool = option(False, "Make gains of a fit that must not be used; they are marked.", ADVANCED)

    def agree(self) -> None:
        """Refuse options that mean nothing together."""
        if self.duty_limits is not None and not self.duty_limits[0] < self.duty_limits[1]:
            low, high = self.duty_limits
            raise UsageError(f"«duty_limits» {low:g},{high:g}: must rise")
        by_frequency = self.natural_frequency is not None or self.damping is not None
        if by_frequency and (self.kp is not None or self.kd is not None):
            raise UsageError("give either «kp» and «kd», or «natural_frequency» and «damping», not both")
        for one, other in (("natural_frequency", "damping"), ("pi_overshoot", "pi_settling")):
            if (getattr(self, one) is None) != (getattr(self, other) is None):
                raise UsageError(f"«{one}» and «{other}» belong together: give both or neither")
        if self.pi_gains is not None and self.pi_overshoot is not None:
            raise UsageError("give either «pi_gains» or «pi_overshoot» with «pi_settling», not both")


@dataclass(frozen=True, kw_only=True)
class RigExtras(Options):
    """What a rig adds to the plant of a replay; the default is none of it.

    Noise is added to the torque that the controller reads at t_k; its duty waits `delay_samples`, and is latched at the
    next start of a PWM period.
    """

    noise_nm: float = option(0.0, "Noise on the measured torque, sd [N·m].", RIG)
    delay_samples: int = option(0, "Control delay, beside the plant's [samples].", RIG, least=0, most=100_000)
    pwm_hz: float = option(0.0, "Duty latched once a PWM period [Hz]; 0: off.", RIG)


@dataclass(frozen=True, kw_only=True)
class SimulateOptions(Chance, RigExtras):
    """What is replayed, on what rig, with what limb."""

    controller: OptionWords | None = option(None, "By itself rc,pi; sweep adds open-loop.", WHAT, words=CONTROLLERS)
    scenario: str | None = option(None, "By itself multisine.", WHAT, words=SCENARIOS)
    duration: float | None = option(None, "Length of steps, multisine or rehab [s].", WHAT, above=True)
    rate_hz: float | None = option(None, "Control rate [Hz]; by itself the gains', else 1000.", RIG, **RATE)
    plants: int | None = option(None, "Also on plants drawn from the fit's uncertainty.", MORE, least=1, most=100_000)
    limb_damping: float | None = option(None, "Damping of the limb [N·m·s/rad].", REHAB)

    def agree(self) -> None:
        """Refuse options that do nothing together."""
        if self.scenario != "rehab" and self.limb_damping is not None:
            raise UsageError("«limb_damping»: belongs to «scenario» rehab; leave it out")

    def check_for(self, what: str) -> None:
        """Refuse what does nothing for a scenario, a `reference`, or recorded runs (`log`)."""
        if self.plants is not None and what in ("log", "rehab"):
            raise UsageError("«plants»: goes with steps, multisine, sweep or «reference»; leave it out")
        if self.rate_hz is not None and what == "log":
            raise UsageError("«rate_hz»: does not go with «log», which has a rate of its own; leave it out")
        if self.duration is not None and what in ("log", "reference"):
            raise UsageError(f"«duration»: does not go with «{what}», which says how long it is")


@dataclass(frozen=True, kw_only=True)
class CoupleOptions(Options):
    """The limb, the timing, the torques and the loops."""

    loops: OptionWords = option(LOOPS, "Loops that are judged.", LOOP, words=LOOPS, shown="NAME,…")
    rate_hz: float | None = option(None, "Control rate [Hz]; by itself the gains', or the rig's.", LOOP, **RATE)
    pwm_hz: float = option(0.0, "Duty latched at [Hz]; 0: at once.", LOOP)
    delay_samples: int = option(0, "Control delay, beside the plant's [samples].", LOOP, least=0, most=100_000)
    replay: bool = option(True, "Also bisect replays of the nonlinear plant.", LOOP)
    torque: Numbers = option((), "Torques held; by itself four over the fitted range.", LIMB, shown="1,2,3")
    wall: float | None = option(None, "A stiffness that has to be rendered [N·m/rad].", LIMB, above=True)
    virtual_damping: float = option(0.0, "B_v of the wall [N·m·s/rad].", LIMB)
    limb_inertia: float = option(0.1, "[kg·m²]", LIMB, least=1e-6, most=1e6)
    limb_damping: float = option(0.8, "[N·m·s/rad]", LIMB, above=True)
    encoder_counts: int | None = option(None, "Counts a turn of the limb.", LIMB, least=1, most=10**9)
    idle_drag_nm: float | None = option(None, "Torque of the idle clutch; by itself the fit's idle.", LIMB)
    rotor_rpm: float = option(10.0, "Speed of the rotor.", LIMB)
    limb_speed_rad_s: float = option(0.41, "Fastest motion of the limb; by itself 25° at 0.15 Hz.", LIMB)


@dataclass(frozen=True, kw_only=True)
class SessionsOptions(Options):
    """How sessions are held together."""

    reference_level: float | None = option(
        None, "Level that tilt is counted from; by itself a middle one, or the likeliest.", SESSIONS, **POSITIVE
    )
    terms: int | None = option(
        None, "Of the common line in ln level: 1, 2 or 3; by itself one a level where all sessions have the same "
        "levels, else 3.", SESSIONS, least=1, most=3,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CompareOptions(Chance):
    """How a recorded loop is held against its promise."""

    controller: str | None = option(
        None, "Which loop ran in the log; by itself the first that the gains or the replay hold.", SESSIONS,
        words=CONTROLLERS,
    )  # fmt: skip
    plants: int = option(60, "Plants that the promise's interval is made of.", SESSIONS, least=10, most=100_000)


@dataclass(frozen=True, kw_only=True)
class ExportOptions(Options):
    """Target, laws and timing of an export."""

    target: str = option("c", "Language or format.", LOGS, "--as", words="c|arduino|matlab|fmu|yaml")
    law: OptionWords | None = option(None, "By itself all that the files hold.", LOGS, words=LAWS)
    precision: Literal["double", "single"] = option("double", "Of the numbers.", LOGS)
    rate_hz: float | None = option(None, "Control rate, baked in [Hz]; by itself the gains'.", RIG, **RATE)
    duty_on_fault: float = option(0.0, "Duty while an input is no number.", RIG, least=-1e9, most=1e9)
    anyway: bool = option(False, "Export what would be refused; its files are marked.", ADVANCED)


@dataclass(frozen=True, kw_only=True)
class Limits(Options):
    """What a rig allows of a planned sequence of inputs."""

    duty: Pair = option(
        (10.0, 100.0), "Lowest and highest input above rest.", RIG, shown="10:100", above=True, rises="<"
    )
    hold_s: Pair = option((0.3, 30.0), "Shortest and longest hold [s].", RIG, shown="0.3:30", above=True, rises="<=")
    rest_s: float = option(5.0, "Length of a return to rest, and of the rest before the first level [s].", RIG)
    engagements: int = option(4, "Stretches under load between rests, at least.", RIG, least=1, most=1000)
    work_s: float = option(0.0, "Longest stretch under load [s]; 0: any.", RIG)
    longest_s: float = option(3600.0, "Longest sequence that is looked for [s].", RIG, least=1, most=1e6)
    unit: str = option("%", "Of the input.", RIG)


@dataclass(frozen=True, kw_only=True)
class PlanOptions(Chance):
    """What intervals are wanted, and what the rig allows."""

    want: Mapping[str, float] = option(
        {}, "Half-widths in percent at the worst level; by itself Ts=3,tau1=5,tau2=10, of one recording 1, 4, 13.",
        LOGS, shown="NAME=PERCENT,…",
    )  # fmt: skip
    check: bool = option(True, "Simulate the experiment and measure the widths it gives.", LOGS)
    idle_s: float = option(10.0, "Input 0 before each step [s].", RIG, "--idle")
    release_s: float | None = option(
        None, "Input 0 after each step, recorded [s]; by itself 10, or until little is left of it.", RIG, "--release"
    )
    longest_hold_s: float | None = option(
        None, "Longest hold [s]; by itself 120, of slower rigs more.", RIG, "--longest-hold", least=5, most=1e6
    )
    most_levels: int = option(12, "Most levels to record.", RIG, least=4, most=100)
    limits: str | Mapping[str, Any] | Limits | None = option(
        None, "Of the excitation: duty=10:100,hold_s=0.3:30,rest_s=5,work_s=60,engagements=4, in "
        "the input's unit; by itself the duty's range is that of the fit.", RIG, shown="NAME=VALUE,…",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class InputOptions(Options):
    """How the input of one log is made where it does more than step from rest, in the rig's own units."""

    kind: str = option("random", "What the input does.", INPUTS, words=EXCITATIONS)
    duration_s: float = option(240.0, "[s]", INPUTS, above=True)
    duty: Pair | None = option(None, "Lowest and highest input.", INPUTS, shown="10:100", rises="<")
    levels: int = option(10, "Different levels of a staircase or of random steps.", INPUTS, least=2, most=10_000)
    hold_s: Pair = option((0.5, 20.0), "Shortest and longest hold [s].", INPUTS, shown="0.3:30", above=True, rises="<=")
    idle_s: float = option(2.0, "Input 0 at first [s].", INPUTS)
    rest_s: float = option(0.0, "Return to 0 after every `levels` holds of random steps [s]; 0: none.", INPUTS)
    rate_hz: float = option(1000.0, "Samples a second [Hz].", INPUTS, **RATE)

    def agree(self) -> None:
        """Refuse what another kind of input has."""
        for name in self.given():
            if self.kind not in USED_BY.get(name, EXCITATIONS):
                raise UsageError(
                    f"«shape» {name}: does nothing for «excitation» {self.kind}, but for {', '.join(USED_BY[name])}; "
                    "leave it out"
                )


@dataclass(frozen=True, kw_only=True)
class SynthOptions(Chance):
    """What is recorded synthetically; None: as the kind of rig has it."""

    kind: ExperimentKind | None = option(None, "By itself clutch; of a fit.json, its own.", LOGS)
    levels: Numbers | None = option(None, "30,40,90 or from:to:step.", LOGS, read=spaced, levels=True, above=True)
    repeats: int | None = option(None, "Runs of each level.", LOGS, least=1, most=10_000)
    idle_s: float | None = option(None, "Input 0 before the step [s].", WHEN, "--idle")
    hold_s: float | None = option(None, "Input at its level [s].", WHEN, "--hold", above=True)
    release_s: float | None = option(None, "Input 0 after the step [s].", WHEN, "--release")
    rate_hz: float | None = option(None, "Samples a second [Hz].", WHEN, **RATE)
    clean: bool = option(False, "The plant alone: no noise, scatter, offset or digits.", HOW)
    white_nm: float | None = option(None, "White noise, sd [N·m].", HOW, "--noise-nm")
    coloured: float | None = option(None, "Coloured noise, sd, share of torque.", HOW, least=0, most=10)
    coloured_s: float | None = option(None, "Its time constant [s].", HOW)
    ripple: float | None = option(None, "Rotor ripple, amplitude, share of torque.", HOW, least=0, most=10)
    gain_scatter: float | None = option(None, "Run-to-run sd of the torque's gain, share.", HOW, least=0, most=0.3)
    tau1_scatter: float | None = option(None, "Run-to-run sd of log τ1.", HOW, least=0, most=3)
    tau2_scatter: float | None = option(None, "Run-to-run sd of log τ2.", HOW, least=0, most=3)
    offset_nm: float | None = option(None, "Offset of the torque sensor [N·m].", HOW, **ANY)
    duty_file: Path | None = option(None, "CSV time_s,duty_pct (force_n, speed_rpm, input).", INPUTS, shown="FILE")
    excitation: str | None = option(None, "Logs to be fitted as recorded.", INPUTS, words=EXCITATIONS)
    shape: str | Mapping[str, Any] | None = option(
        None, "Of the excitation: duration_s=240,hold_s=0.5:20,duty=10:100,levels=10,rest_s=5,idle_s=2, in the "
        "rig's units.", INPUTS, shown="NAME=VALUE,…",
    )  # fmt: skip

    def agree(self) -> None:
        """Refuse options that do nothing together."""
        if self.shape and self.excitation is None:
            raise UsageError("«shape»: does nothing without «excitation»; leave it out")
        if self.duty_file is not None and self.excitation is not None:
            raise UsageError("«duty_file» and «excitation» exclude each other; give one of them")
        timing = (self.levels, self.idle_s, self.hold_s, self.release_s)
        if (self.duty_file or self.excitation) and any(value is not None for value in timing):
            name = "excitation" if self.duty_file is None else "duty_file"
            raise UsageError(
                f"«{name}»: says levels and times itself; leave out «levels», «idle_s», «hold_s», «release_s»"
            )


@dataclass(frozen=True, kw_only=True)
class ReportOptions(Options):
    """How a report is made."""

    figures: OptionWords = option((), "Only these: fig07,fig12 or the beginning of a name.", FIGURES, shown="NAME,…")
    tables: Path | None = option(None, "All tables as CSV and LaTeX, in this folder.", FIGURES, shown="DIR")
    format: OptionWords = option((), "Beside PNG, which is always there.", FIGURES, words="pdf|svg|png")
