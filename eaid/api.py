"""The public functions: logs → steps → fit → gains → replay → page, each a plain call that prints nothing.

Examples
--------
>>> import eaid
>>> logs = eaid.synth(levels=(20.0, 40.0, 60.0, 80.0, 100.0), repeats=2, rate_hz=100.0, seed=1)
>>> fit = eaid.fit(logs)
>>> fit.converged
True
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import h5py
import msgspec

from eaid.errors import DataError, UsageError, unknown
from eaid.logs.frames import runs_from_frames
from eaid.progress import Progress, no_progress
from eaid.reading import InputOptions, read_steps, steps_of
from eaid.results import codec
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit, FitOptions
from eaid.results.gains import Gains
from eaid.results.plan import Plan
from eaid.results.recorded import Excitation
from eaid.results.replay import Replay
from eaid.results.tuning import TuneOptions
from eaid.steps.levels import wanted_levels
from eaid.steps.stepset import StepSet
from eaid.uncertainty.workflow import fit_steps

if TYPE_CHECKING:
    import pandas

    from eaid.coupling.options import CoupleOptions
    from eaid.export.export import ExportFolder
    from eaid.export.options import ExportOptions
    from eaid.planning.excitation import ExcitationOptions
    from eaid.planning.recordings import PlanOptions
    from eaid.replay.options import SimulateOptions

K = TypeVar("K")

Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]
Frames = "pandas.DataFrame | Mapping[str, pandas.DataFrame]"


def read(
    source: "Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    *,
    time: str | int | None = None,
    input: str | int | None = None,
    output: str | int | None = None,
    progress: Progress = no_progress,
    logs_as: str = "auto",
    **options: Any,
) -> StepSet:
    """Read recorded logs and find their steps, levels and repeats.

    Parameters
    ----------
    source
        Files or folders of logs, a data.h5, a DataFrame (with a column `run` where it holds several), or a mapping of
        run name to DataFrame.
    time, input, output
        Columns by name or number from 1, where they are not found by themselves.
    progress
        `progress(what, how_many)` gives a context with a function to call once a piece.
    logs_as
        auto: logs whose input does more than step from rest stand uncut in `recorded`; steps: none do; recorded: all.
    **options
        Fields of `eaid.reading.InputOptions`: units, name_pattern, step_at, until, baseline, rest, repair, kind, …

    Returns
    -------
    StepSet
        With `to_frame()`, `findings` and `save("data.h5")`.

    Raises
    ------
    DataError
        With one sentence for every fault of every log.
    UsageError
        An option that means nothing.

    Examples
    --------
    >>> import eaid, numpy, pandas
    >>> time = numpy.arange(0.0, 25.0, 0.02)
    >>> torque = 2.0 * (1.0 - numpy.exp(-(time - 5.0).clip(0.0) / 0.3))
    >>> frame = pandas.DataFrame({"time_s": time, "duty_pct": 60.0 * (time >= 5.0), "torque_nm": torque})
    >>> steps = eaid.read({"first": frame})
    >>> [level.level for level in steps.levels]
    [60.0]
    """
    columns = {
        role: str(name) for role, name in (("time", time), ("input", input), ("output", output)) if name is not None
    }
    chosen = InputOptions(**{**({"columns": columns} if columns else {}), **_known(InputOptions, options)})
    if _is_frames(source):
        return steps_of(runs_from_frames(source, chosen.reading()), chosen, whole=logs_as)[1]  # type: ignore[arg-type]
    return read_steps(_paths(source), chosen, progress, whole=logs_as)[1]  # type: ignore[arg-type]


def fit(
    data: "StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    options: FitOptions | None = None,
    *,
    progress: Progress = no_progress,
    bounds_levels: "str | Sequence[float] | None" = None,
    duty: tuple[float, float] | None = None,
    instrument: bool = False,
    workers: int = 1,
    **keywords: Any,
) -> Fit:
    """Fit the models of the paper to recorded steps, with intervals and a verdict.

    Parameters
    ----------
    data
        What `read` returns, or anything that `read` takes.
    options
        All choices at once; single ones as keywords: models, share, weights, loss, hold_out, bounds, estimator, ci, …
    progress
        As in `read`.
    bounds_levels
        Levels over which B_m and B_M are taken, as numbers or as "20:100".
    duty, instrument
        Of logs that are fitted as they were recorded: identified inputs, and the simulated duty as an instrument.
    workers
        Processes that share the refits of a bootstrap; the result is the same for any number.

    Returns
    -------
    Fit
        With `summary()`, `params`, `conf_int()`, `to_frame()`, `predict()`, `plot()`, `findings`, `save("fit.json")`.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> fit.to_frame()["Ts"].round(1).tolist()
    [0.3, 1.6, 4.1]
    >>> low, high = fit.conf_int().loc[("friction", "tau1(100)")]
    >>> bool(low < fit.params[("friction", "tau1(100)")] < high)
    True
    """
    chosen = _chosen(FitOptions, options, keywords)
    steps = data if isinstance(data, StepSet) else read(data, progress=progress)
    if bounds_levels is not None:
        text = bounds_levels if isinstance(bounds_levels, str) else ",".join(f"{u:.17g}" for u in bounds_levels)
        kept = wanted_levels(text, [level.level for level in steps.levels], "bounds_levels")
        chosen = msgspec.structs.replace(chosen, bounds_levels=tuple(kept))
    if steps.recorded:
        from eaid.recorded.entry import fit_whole

        return fit_whole(steps, chosen, duty, instrument)
    for name, given in (("duty", duty), ("instrument", instrument or None)):
        if given is not None:
            raise UsageError(
                f"«{name}»: belongs to logs that are fitted as recorded, and these are steps; leave it out"
            )
    with progress("bootstrap refits", chosen.draws if chosen.ci == "bootstrap" else 0) as advance:
        return fit_steps(steps, chosen, advance, workers)


def tune_rc(
    fit: Fit,
    options: TuneOptions | None = None,
    *,
    reference: "str | os.PathLike[str] | None" = None,
    logs: StepSet | None = None,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Gains:
    """Gains of the robust controller and of a PI, with one verdict on the guarantee.

    Parameters
    ----------
    fit
        A fit with a linear model.
    options
        All choices at once; single ones as keywords: kp, kd, b_hat, rho, phi, pi_overshoot, …
    reference
        A scenario (multisine, steps, sweep, ramp), or a file `time_s,reference_nm`, which Q_M is judged by.
    logs
        Steps of the same rig, which speak about φ and the noise.

    Returns
    -------
    Gains
        With `guarantee`, `findings`, `to_control()`, `save("gains.json")`.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> gains = eaid.tune_rc(fit)
    >>> gains.rc.K_P, gains.rc.K_D
    (4.5, 3.0)
    >>> gains.guarantee.holds, "duty-limit" in gains.guarantee.missing
    (False, True)
    """
    from eaid.coupling.judge import stiffness_judge
    from eaid.replay.references import read_reference
    from eaid.replay.scenarios import SCENARIOS
    from eaid.replay.tune import tune

    chosen = _chosen(TuneOptions, options, keywords)
    judge = stiffness_judge(fit) if chosen.optimize_for == "stiffness" else None
    named = "" if reference is None else str(reference)
    signal = (named or None) if reference is None or named in SCENARIOS else read_reference(Path(reference))
    return tune(fit, chosen, logs, signal, named, progress, judge)


def simulate(
    fit: Fit,
    gains: Gains | None = None,
    scenario: str | None = None,
    *,
    options: "SimulateOptions | None" = None,
    reference: "str | os.PathLike[str] | None" = None,
    log: "Paths | None" = None,
    reading: InputOptions | None = None,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Replay:
    """Replay controllers on the fitted plant, or a log's own input.

    Parameters
    ----------
    fit
        A fit with a nonlinear model.
    gains
        Gains of `tune_rc`; controllers that need them are left out without.
    scenario : {"steps", "multisine", "sweep", "ramp", "rehab"}, optional
    options
        All choices at once.
    reference
        A file `time_s,reference_nm` in place of a scenario.
    log, reading
        Logs whose recorded input is replayed and compared, and how they are read.
    **keywords
        Fields of `SimulateOptions` and of `Rig` (noise_nm, pwm_hz, delay_samples, …).

    Returns
    -------
    Replay
        With `to_frame()`, `plot()`, `findings`, `save("replay.h5")`.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> gains = eaid.tune_rc(fit)
    >>> run = eaid.simulate(fit, gains, "multisine", noise_nm=0.01)
    >>> sorted(set(run.to_frame()["name"]))
    ['pi', 'rc']
    """
    from eaid.coupling.entry import with_wall_findings
    from eaid.logs.read import read_runs
    from eaid.replay.options import SimulateOptions, refuse_several
    from eaid.replay.references import read_reference
    from eaid.replay.rig import Rig
    from eaid.replay.simulate import simulate as replayed

    of_rig = {field.name for field in fields(Rig)}
    rig = Rig(**{name: value for name, value in keywords.items() if name in of_rig})
    rest = {name: value for name, value in keywords.items() if name not in of_rig}
    chosen = options or SimulateOptions(scenario=scenario, rig=rig, **_known(SimulateOptions, rest))
    refuse_several(chosen.scenario, reference, log)
    signal = None if reference is None else read_reference(Path(reference))
    if log is not None:
        chosen.check_for("log")
    runs = None if log is None else read_runs(_paths(log), (reading or InputOptions()).reading())
    return with_wall_findings(replayed(fit, gains, chosen, signal, runs, progress), fit, gains)


def report(
    results: "Sequence[Fit | Gains | Replay | StepSet | Coupling]",
    output_dir: str | os.PathLike[str],
    **options: Any,
) -> Path:
    """Write one self-contained page, and the figures, of any results; returns the page's path.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> import pathlib, tempfile
    >>> page = eaid.report([fit], pathlib.Path(tempfile.mkdtemp()) / "report")
    >>> page.name
    'report.html'
    """
    from eaid.report.options import ReportOptions
    from eaid.report.write import write_report

    return write_report(list(results), output_dir, ReportOptions(**_known(ReportOptions, options))).page


def plan(fit: Fit, options: "PlanOptions | None" = None, *, progress: Progress = no_progress, **keywords: Any) -> Plan:
    """What steps to record next, for intervals of wanted widths, in the rig's own input unit.

    Parameters
    ----------
    fit
        What is known of the rig: its model, noise and scatter.
    options
        All choices at once; single ones as keywords: want, idle_s, release_s, longest_hold_s, most_levels, check, seed.
    progress
        As in `read`; called once a simulated recording.

    Returns
    -------
    Plan
        With `runs`, `to_frame()`, `findings`.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> made = eaid.plan(fit, want={"Ts": 10.0}, check=False)
    >>> len(made.runs) == len(made.to_frame())
    True
    """
    from eaid.planning.recordings import PlanOptions, plan_recordings

    with progress("simulated recordings", 0) as advance:
        return plan_recordings(fit, _chosen(PlanOptions, options, keywords), advance)


def plan_excitation(
    fit: Fit, options: "ExcitationOptions | None" = None, *, progress: Progress = no_progress, **keywords: Any
) -> Excitation:
    """The shortest sequence of inputs for one recording, for intervals of wanted widths, in the rig's own input unit.

    Parameters
    ----------
    fit
        A fit with a nonlinear model.
    options
        All choices at once; single ones as keywords: want, limits (`eaid.recorded.sequence.Limits`, by itself the
        input's identified range), check, seed.
    progress
        As in `read`; called once a simulated recording.

    Returns
    -------
    Excitation
        With `duty` (from when [s], input), its `input_unit`, the widths it gives, what steps would take, `findings`.

    Raises
    ------
    UsageError
        A width of no parameter, or limits that leave nothing.
    DataError
        A fit without a nonlinear model.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> made = eaid.plan_excitation(fit, want={"Ts": 5.0}, check=False)
    >>> made.duty[0], made.input_unit
    ((0.0, 0.0), '%')
    """
    from eaid.planning.excitation import ExcitationOptions, shortest_recording

    with progress("simulated recordings", 0) as advance:
        return shortest_recording(fit, _chosen(ExcitationOptions, options, keywords), advance)


def synth(plant: Fit | None = None, gains: Gains | None = None, **options: Any) -> StepSet:
    """Synthetic logs of the reference plant, or of a fitted rig in its own units.

    Parameters
    ----------
    plant
        A fit; without one the paper's clutch, or the friction rig of `kind`.
    gains
        Whose controller ("pi" or "rc", by `controller`) drives a closed loop.
    **options
        Fields of `SynthOptions`: levels, repeats, idle_s, hold_s, release_s, rate_hz, seed, clean, sizes; in place of
        steps duty_file, plan, or excitation ("random", "staircase", "prbs", "multisine", "chirp", "closed-loop") with
        its shape (duration_s, duty, hold_s, levels, frequency_hz, …).

    Returns
    -------
    StepSet
        The steps; logs of an excitation stand uncut in `recorded`.

    Raises
    ------
    UsageError
        What is asked for cannot be recorded.
    DataError
        The fit holds no plant, or a file is no such table.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0), repeats=2, rate_hz=50.0, seed=1)
    >>> [level.level for level in logs.levels]
    [20.0, 60.0]
    >>> shape = {"duration_s": 60.0, "hold_s": (0.5, 8.0), "duty": (20.0, 80.0)}
    >>> logs = eaid.synth(excitation="random", shape=shape, rate_hz=100.0)
    >>> float(logs.recorded[0].input.max()), eaid.fit(logs).nonlinear.u_range
    (80.0, (20.0, 80.0))
    """
    from eaid.synth.synthesize import SynthOptions, synthesize

    chosen = SynthOptions(**_known(SynthOptions, options))
    runs = synthesize(chosen, plant, gains=gains)
    return steps_of(runs, InputOptions(), whole="auto" if chosen.duty_file or chosen.excitation else "steps")[1]


def export(
    gains: Gains | None,
    output_dir: "str | os.PathLike[str] | None" = None,
    fit: Fit | None = None,
    options: "ExportOptions | None" = None,
    **keywords: Any,
) -> "ExportFolder":
    """Controllers and plant as source for a rig, with test vectors and a check program; fields of `ExportOptions`.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> gains = eaid.tune_rc(fit)
    >>> import pathlib, tempfile
    >>> made = eaid.export(gains, pathlib.Path(tempfile.mkdtemp()) / "rig", target="yaml")
    >>> made.laws, "parameters.yaml" in made.files
    (('pi', 'rc'), True)
    """
    from eaid.export.export import export as exported
    from eaid.export.options import ExportOptions

    where = {} if output_dir is None else {"folder": Path(output_dir)}
    return exported(gains, fit, _chosen(ExportOptions, options, {**keywords, **where}))


def couple(
    fit: Fit,
    gains: Gains | None = None,
    options: "CoupleOptions | None" = None,
    *,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Coupling:
    """How stiff a virtual wall each loop may render on a limb.

    Parameters
    ----------
    fit
        A fit with a nonlinear model, which is the plant.
    gains
        Gains of the loops rc and pi; without them the open loop and the inverse remain.
    options
        All choices at once; single ones as keywords: limb_inertia, limb_damping, torques, pwm_hz, plants, …

    Returns
    -------
    Coupling
        With `walls`, `pair`, `regions`, `to_frame()`, `findings`, `save("couple.json")`.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> gains = eaid.tune_rc(fit)
    >>> found = eaid.couple(fit, gains, torques=(1.0,), loops=("pi", "rc"), replay=False)
    >>> [wall.loop for wall in found.walls]
    ['pi', 'rc']
    """
    from eaid.coupling.entry import CoupleOptions, couple_fit

    return couple_fit(fit, gains, _chosen(CoupleOptions, options, keywords), progress)


def load(path: str | os.PathLike[str]) -> "Fit | Gains | Coupling | Replay | StepSet":
    """A result of any kind from its file, by what the file says of itself.

    Examples
    --------
    >>> import eaid
    >>> logs = eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)
    >>> fit = eaid.fit(logs)
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "fit.json"
    >>> fit.save(file)
    >>> eaid.load(file).params.equals(fit.params)
    True
    """
    file = Path(path)
    if not file.is_file():
        raise DataError(f"{file}: no such file; give a fit.json, gains.json, couple.json, replay.h5 or data.h5")
    if h5py.is_hdf5(file):
        from eaid.replay.files import SCHEMA
        from eaid.replay.files import read as read_replay

        with h5py.File(file) as held:
            schema = held.attrs.get("schema", "")
        return read_replay(file)[0] if schema == SCHEMA else read(file)
    kinds: dict[str, type[Any]] = {"fit": Fit, "gains": Gains, "couple": Coupling}
    kind = codec.kind_of(file)
    result: Fit | Gains | Coupling = codec.read(file, kind, kinds[kind])[0]
    return result


def _known(options: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """The keywords, held against the fields of an options type."""
    for name in given:
        if name not in _names(options):
            raise UsageError(unknown("no such option", name, _names(options)))
    return dict(given)


def _names(options: type) -> Sequence[str]:
    return getattr(options, "__struct_fields__", None) or [field.name for field in fields(options)]


def _chosen(kind: type[K], options: K | None, keywords: Mapping[str, Any]) -> K:
    """Options given whole, or the defaults, with single ones changed."""
    known = _known(kind, keywords)
    told = {} if options is None else {name: getattr(options, name) for name in _names(kind)}
    return kind(**{**told, **known})


def _is_frames(source: Any) -> bool:
    return hasattr(source, "columns") or isinstance(source, Mapping)


def _paths(source: Paths) -> list[Path]:
    given = [source] if isinstance(source, str | os.PathLike) else list(source)
    paths = [Path(one) for one in given]
    if any(str(one) == "" for one in given):
        raise UsageError("an empty path: give a file or a folder")
    return paths
