"""Public names with their signatures; `python docs/stub.py` wrote this file."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pandas
from numpy.typing import ArrayLike
from eaid.api.given import AnyResult
from eaid.api.given import File
from eaid.api.given import GivenTables
from eaid.api.given import OneColumn
from eaid.api.given import Paths
from eaid.apparatus import Apparatus
from eaid.errors import DataError as DataError
from eaid.errors import EaidError as EaidError
from eaid.errors import GainsError as GainsError
from eaid.errors import UsageError as UsageError
from eaid.export.export import ExportFolder
from eaid.options import CompareOptions as CompareOptions
from eaid.options import CoupleOptions as CoupleOptions
from eaid.options import ExportOptions as ExportOptions
from eaid.options import FitOptions as FitOptions
from eaid.options import Limits
from eaid.options import PlanOptions as PlanOptions
from eaid.options import ReadOptions as ReadOptions
from eaid.options import ReportOptions as ReportOptions
from eaid.options import SessionsOptions as SessionsOptions
from eaid.options import SimulateOptions as SimulateOptions
from eaid.options import SynthOptions as SynthOptions
from eaid.options import TuneOptions as TuneOptions
from eaid.progress import Progress
from eaid.replay.controllers import OwnLaw
from eaid.results.coupling import Coupling as Coupling
from eaid.results.fit import Fit as Fit
from eaid.results.gains import Gains as Gains
from eaid.results.plan import Excitation
from eaid.results.plan import Plan as Plan
from eaid.results.replay import Replay as Replay
from eaid.sessions.compare import Comparison
from eaid.sessions.rig import Rig
from eaid.steps.stepset import StepSet as StepSet
from eaid.version import __version__ as __version__

def tune_rc(
    fit: Fit | File,
    options: TuneOptions | None = None,
    *,
    reference: File | ArrayLike | pandas.Series[float] | None = None,
    kp: float | None = None,
    kd: float | None = None,
    natural_frequency: float | None = None,
    damping: float | None = None,
    b_hat: Literal["pooled", "minimax"] | float | None = None,
    q_max: float | None = None,
    phi: Literal["data"] | float | None = None,
    pi_gains: Sequence[float] | str | None = None,
    pi_overshoot: float | None = None,
    pi_settling: float | None = None,
    duty_limits: Sequence[float] | str | None = None,
    rate_hz: float | None = None,
    pwm_hz: float | None = None,
    epsilon: float | None = None,
    gamma: float | None = None,
    p_scale: float = 5.0,
    rho: Literal["paper", "textbook"] = "paper",
    anyway: bool = False,
    seed: int = 0,
) -> Gains:
    """Gains of the robust controller, Eqs. (11) to (15), and of a PI, with one verdict on the guarantee."""

def simulate(
    fit: Fit | File,
    gains: Gains | File | None = None,
    scenario: str | None = None,
    options: SimulateOptions | None = None,
    *,
    controller: str | OwnLaw | Sequence[str | OwnLaw] | None = None,
    reference: File | ArrayLike | pandas.Series[float] | Callable[[float], float] | None = None,
    log: Paths | GivenTables | None = None,
    reading: ReadOptions | None = None,
    progress: Progress = ...,
    noise_nm: float = 0.0,
    delay_samples: int = 0,
    pwm_hz: float = 0.0,
    duration: float | None = None,
    rate_hz: float | None = None,
    plants: int | None = None,
    limb_damping: float | None = None,
    seed: int = 0,
) -> Replay:
    """Replay controllers on the fitted plant from rest, or a log's own input."""

def couple(
    fit: Fit | File,
    gains: Gains | File | None = None,
    options: CoupleOptions | None = None,
    *,
    progress: Progress = ...,
    loops: Sequence[str] | Literal["open-loop", "pi", "rc-no-rate", "rc"] = ("open-loop", "pi", "rc-no-rate", "rc"),
    rate_hz: float | None = None,
    pwm_hz: float = 0.0,
    delay_samples: int = 0,
    replay: bool = True,
    torque: Sequence[float] | float | str = (),
    wall: float | None = None,
    virtual_damping: float = 0.0,
    limb_inertia: float = 0.1,
    limb_damping: float = 0.8,
    encoder_counts: int | None = None,
    idle_drag_nm: float | None = None,
    rotor_rpm: float = 10.0,
    limb_speed_rad_s: float = 0.41,
) -> Coupling:
    """How stiff a virtual wall each loop may render on a limb (Colgate and Schenkel 1997 for the sampled loop)."""

def export(
    gains: Gains | File | None,
    output_dir: File = "export",
    fit: Fit | File | None = None,
    options: ExportOptions | None = None,
    *,
    force: bool = False,
    target: Literal["c", "arduino", "matlab", "fmu", "yaml"] = "c",
    law: Sequence[str] | Literal["pi", "rc", "pi-feedforward", "inverse", "plant"] | None = None,
    precision: Literal["double", "single"] = "double",
    rate_hz: float | None = None,
    duty_on_fault: float = 0.0,
    anyway: bool = False,
) -> ExportFolder:
    """Controllers and plant as source for a rig, with test vectors and a check program."""

def read(
    source: Paths | GivenTables,
    options: ReadOptions | None = None,
    *,
    time: OneColumn = None,
    input: OneColumn = None,
    output: OneColumn = None,
    progress: Progress = ...,
    columns: Mapping[str, Any] | str = {},
    units: Mapping[str, Any] | str = {},
    variable: str | None = None,
    repair: bool = False,
    name_pattern: str | None = None,
    where: Mapping[str, Any] | str = {},
    rate_hz: float | None = None,
    kind: Literal["clutch", "friction-force", "friction-speed"] | None = None,
    levels: str | Sequence[float] | None = None,
    baseline: str = "auto",
    rest: float = 0.0,
    step_at: float | None = None,
    until: float | None = None,
    apparatus: Apparatus | None = None,
    logs_as: Literal["auto", "steps", "recorded"] = "auto",
) -> StepSet:
    """Read recorded logs and find their steps, levels and repeats."""

def fit(
    data: StepSet | Paths | GivenTables | ArrayLike,
    *arrays: ArrayLike | FitOptions,
    options: FitOptions | None = None,
    progress: Progress = ...,
    model: Sequence[str] | Literal["friction", "nonlinear", "linear"] | None = None,
    share: float | Literal["free"] = 0.85,
    estimator: Literal["auto", "joint"] = "auto",
    curve: Literal["auto", "cubic", "levels", "spline"] = "auto",
    ci: Literal["robust", "bootstrap", "white", "none"] = "robust",
    draws: int = 300,
    hold_out: Sequence[float] | float | str = (),
    loss: Literal["squares", "huber"] = "squares",
    duty: Sequence[float] | str | None = None,
    bounds_levels: str | Sequence[float] | None = None,
    shape: Literal["auto", "one", "two", "free", "overshoot"] = "auto",
    dead_time: float | Literal["auto"] = "auto",
    seed: int = 0,
) -> Fit:
    """Fit the models of the paper to recorded steps, Eqs. (3) to (8), with intervals and a verdict."""

def plan(
    fit: Fit | File,
    options: PlanOptions | None = None,
    *,
    excitation: bool = False,
    progress: Progress = ...,
    want: Mapping[str, Any] | str = {},
    check: bool = True,
    idle_s: float = 10.0,
    release_s: float | None = None,
    longest_hold_s: float | None = None,
    most_levels: int = 12,
    limits: str | Mapping[str, Any] | Limits | None = None,
    seed: int = 0,
) -> Plan | Excitation:
    """What to record next, for intervals of wanted widths, in the rig's own input unit."""

def synth(
    plant: Fit | File | None = None,
    options: SynthOptions | None = None,
    *,
    kind: Literal["clutch", "friction-force", "friction-speed"] | None = None,
    levels: Sequence[float] | float | str | None = None,
    repeats: int | None = None,
    idle_s: float | None = None,
    hold_s: float | None = None,
    release_s: float | None = None,
    rate_hz: float | None = None,
    clean: bool = False,
    white_nm: float | None = None,
    coloured: float | None = None,
    coloured_s: float | None = None,
    ripple: float | None = None,
    gain_scatter: float | None = None,
    tau1_scatter: float | None = None,
    tau2_scatter: float | None = None,
    offset_nm: float | None = None,
    duty_file: str | os.PathLike[str] | None = None,
    excitation: Literal["random", "staircase", "chirp", "closed-loop"] | None = None,
    shape: str | Mapping[str, Any] | None = None,
    seed: int = 0,
) -> StepSet:
    """Synthetic logs of the reference plant, or of a fitted rig in its own units."""

def load(path: File) -> AnyResult | Rig | Comparison:
    """A result of any kind from its file, by what the file says of itself."""

def report(
    *results: AnyResult | File | Sequence[AnyResult | File],
    to: File | None = None,
    options: ReportOptions | None = None,
    force: bool = False,
    figures: Sequence[str] | str = (),
    tables: str | os.PathLike[str] | None = None,
    format: Sequence[str] | Literal["pdf", "svg", "png"] = (),
) -> Path:
    """Write one self-contained page, and the figures, of any results."""

def plot(result: Fit | Gains | Replay | Rig | Comparison, ax: Any = None) -> Any:
    """A result on matplotlib Axes: the step responses of a fit, margins of gains over the input, traces of a replay,"""

def sessions(
    data: pandas.DataFrame | Mapping[str, Fit] | Sequence[Fit] | Fit | Paths,
    *more: Fit | File,
    options: SessionsOptions | None = None,
    reference_level: float | None = None,
    terms: int | None = None,
) -> Rig:
    """Several sessions of one rig, and what its next one may be."""

def today(
    rig: Rig | File,
    step: Fit | StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame],
    reading: ReadOptions | None = None,
    *,
    progress: Progress = ...,
) -> Fit:
    """One or two reference steps of a new session → a fit whose intervals hold for it."""

def compare(
    first: Fit | Replay | File,
    *others: Fit | Paths | GivenTables,
    gains: Gains | File | None = None,
    reading: ReadOptions | None = None,
    names: Sequence[str] | None = None,
    options: CompareOptions | None = None,
    controller: Literal["rc", "pi", "pi-feedforward", "smith", "open-loop", "inverse"] | None = None,
    plants: int = 60,
    seed: int = 0,
) -> Comparison:
    """What moved between sessions; or whether a recorded loop does what its fit and gains promise."""
