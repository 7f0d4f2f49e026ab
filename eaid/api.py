"""The public functions: logs → steps → fit → gains → replay → page, each a call with typed options and results.

The commands call the same functions. A function takes its options whole (`eaid.FitOptions(...)`) or one by one as
keywords; `eaid.options` declares them, and signatures and docstrings say them here. Where a result is taken its file is
taken too.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import msgspec
import numpy

from eaid.declared import chosen, forms, taking
from eaid.errors import DataError, UsageError
from eaid.levels.workflow import fit_steps
from eaid.logs.frames import runs_from_frames
from eaid.options import (
    SCENARIOS,
    TRACKED,
    CompareOptions,
    CoupleOptions,
    ExportOptions,
    FitOptions,
    PlanOptions,
    ReadOptions,
    ReportOptions,
    SessionsOptions,
    SimulateOptions,
    SynthOptions,
    TuneOptions,
)
from eaid.progress import Progress, no_progress
from eaid.reading import read_steps, steps_of
from eaid.replay.compare import of_own_logs
from eaid.results.common import Samples
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.parameters import table_of
from eaid.results.plan import Excitation, Plan
from eaid.results.replay import Replay
from eaid.results.responses import responses_of
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike

    from eaid.export.export import ExportFolder
    from eaid.replay.controllers import OwnLaw
    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig

T = TypeVar("T")
Result = Fit | Gains | Replay | StepSet | Coupling
File = str | os.PathLike[str]
Paths = File | Iterable[File]
Tables: TypeAlias = "pandas.DataFrame | Sequence[pandas.DataFrame] | Mapping[str, Any]"
Column = str | int | None


@taking(ReadOptions)
def read(
    source: "Paths | Tables",
    options: ReadOptions | None = None,
    *,
    time: Column = None,
    input: Column = None,
    output: Column = None,
    progress: Progress = no_progress,
    **keywords: Any,
) -> StepSet:
    """Read recorded logs and find their steps, levels and repeats.

    Parameters
    ----------
    source
        Files or folders of logs, a data.h5, a DataFrame (with a column `run` where it holds several), several of them,
        a mapping of run name to DataFrame, or one of column name to array.
    options
        How the logs are read and cut.
    time, input, output
        Columns by name or number from 1, where they are not found by themselves.
    progress
        `progress(what, how_many)` gives a context with a function to call once a piece.
    **keywords
        Fields of `ReadOptions`, each as above.

    Returns
    -------
    StepSet
        With `levels`, `runs`, `to_frame()`, `findings` and `save("data.h5")`; torque in N·m where the logs hold a
        torque, else in the unit of the logs.

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
    given = {"time": time, "input": input, "output": output}
    columns = {role: str(name) for role, name in given.items() if name is not None}
    if columns and "columns" in keywords:
        raise UsageError(f"«columns»: {next(iter(columns))}= says a column too; say all columns in one place")
    how = chosen(ReadOptions, options, {**({"columns": columns} if columns else {}), **keywords})
    tables = _tables(source)
    if tables is not None:
        return steps_of(runs_from_frames(tables, how), how)[1]
    return read_steps(_paths(source), how, progress)[1]


@taking(FitOptions)
def fit(
    data: "StepSet | Paths | Tables | ArrayLike",
    *arrays: "ArrayLike | FitOptions",
    options: FitOptions | None = None,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Fit:
    """Fit the models of the paper to recorded steps, Eqs. (3) to (8), with intervals and a verdict.

    Parameters
    ----------
    data
        What `read` returns, or anything that `read` takes; or the time [s], with input and output behind it as arrays.
    arrays
        Input and output of one run, where `data` is its time; the output's unit is then not known.
    options
        How it is fitted; also as the second argument.
    progress
        As in `read`.
    **keywords
        Fields of `FitOptions`, each as above.

    Returns
    -------
    Fit
        With `summary()`, `verdict`, `params`, `conf_int()`, `bse`, `to_frame()`, `at()`, `predict()`, `plot()`,
        `residuals`, `rsquared`, `aic`, `findings`, `to_dict()`, `save("fit.json")`.
        Time constants in s, T_s in the output's unit, levels in the input's.

    Raises
    ------
    DataError
        No step, or nothing that a model can be fitted to.
    UsageError
        An option that means nothing, or a model that the kind of experiment does not allow.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> fit.to_frame()["Ts"].round(1).tolist()
    [0.3, 1.6, 4.1]
    >>> low, high = fit.conf_int().loc[("friction", "tau1(100)")]
    >>> bool(low < fit.params[("friction", "tau1(100)")] < high)
    True
    """
    source, options = _measured(data, arrays, options)
    if of_reading := [name for name in keywords if name in forms(ReadOptions) and name not in forms(FitOptions)]:
        raise UsageError(
            f"«{of_reading[0]}»: says how logs are read; give it to eaid.read, and what that returns to fit"
        )
    how = chosen(FitOptions, options, keywords)
    steps = source if isinstance(source, StepSet) else read(source, progress=progress)
    if steps.recorded:
        from eaid.recorded.fit import fit_whole

        with progress("fitting the recorded log", 0):
            fitted = fit_whole(steps, how)
        return msgspec.structs.replace(fitted, parameters=table_of(fitted))
    if how.duty is not None:
        raise UsageError("«duty»: belongs to logs that are fitted as recorded, and these are steps; leave it out")
    refits = how.draws if how.ci == "bootstrap" else 0
    with progress("bootstrap refits" if refits else "fitting", refits) as advance:
        fitted = fit_steps(steps, how, advance)
        if fitted.dead_time_s > 0 or not fitted.verdict.of("nonlinear").usable:
            from eaid.recorded.fit import with_another_kind

            fitted = with_another_kind(fitted, steps, how)
    slipping = {u for one in fitted.findings if one.code == "output-decays-under-hold" for u in one.levels}
    replayed = msgspec.structs.replace(fitted.data, replayed=of_own_logs(fitted, steps.logs))
    fitted = msgspec.structs.replace(fitted, data=replayed)
    found = {"responses": responses_of(steps, slipping), "parameters": table_of(fitted), "samples": Samples(steps)}
    return msgspec.structs.replace(fitted, **found)


@taking(PlanOptions)
def plan(
    fit: "Fit | File",
    options: PlanOptions | None = None,
    *,
    excitation: bool = False,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Plan | Excitation:
    """What to record next, for intervals of wanted widths, in the rig's own input unit.

    Parameters
    ----------
    fit
        What is known of the rig: its model, noise and scatter.
    options
        Wanted widths, and what the rig allows.
    excitation
        The shortest sequence of inputs for one recording, in place of steps; it needs a nonlinear model.
    progress
        As in `read`; called once a simulated recording.
    **keywords
        Fields of `PlanOptions`, each as above.

    Returns
    -------
    Plan or Excitation
        With the widths it gives and `findings`; of steps `runs` and `to_frame()`, of a sequence `duty` (from when [s],
        input) and what steps would take.

    Raises
    ------
    DataError
        A fit without the model that is planned with.
    UsageError
        A width of no parameter, or a limit that no rig has.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> session = eaid.plan(fit, want={"Ts": 10.0}, check=False)
    >>> len(session.runs) == len(session.to_frame())
    True
    >>> sequence = eaid.plan(fit, want={"Ts": 20.0}, check=False, excitation=True)
    >>> sequence.duty[0], sequence.input_unit
    ((0.0, 0.0), '%')
    """
    from eaid.planning.recordings import plan_recordings
    from eaid.planning.sequences import shortest_recording

    fit = _result("fit", fit, Fit)
    how = chosen(PlanOptions, options, keywords)
    with progress("simulated recordings", 0) as advance:
        return (shortest_recording if excitation else plan_recordings)(fit, how, advance)


@taking(SynthOptions)
def synth(plant: "Fit | File | None" = None, options: SynthOptions | None = None, **keywords: Any) -> StepSet:
    """Synthetic logs of the reference plant, or of a fitted rig in its own units.

    Parameters
    ----------
    plant
        A fit; without one the paper's clutch, or the friction rig of `kind`.
    options
        Levels, times, disturbances, or an input in place of steps.
    **keywords
        Fields of `SynthOptions`, each as above.

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
    >>> float(logs.recorded[0].input.max())
    80.0
    """
    from eaid.synth.synthesize import synthesize

    how = chosen(SynthOptions, options, keywords)
    runs = synthesize(how, None if plant is None else _result("plant", plant, Fit))
    return steps_of(runs, ReadOptions(logs_as="auto" if how.duty_file or how.excitation else "steps"))[1]


@taking(TuneOptions)
def tune_rc(
    fit: "Fit | File",
    options: TuneOptions | None = None,
    *,
    reference: "File | ArrayLike | pandas.Series[float] | None" = None,
    **keywords: Any,
) -> Gains:
    """Gains of the robust controller, Eqs. (11) to (15), and of a PI, with one verdict on the guarantee.

    Parameters
    ----------
    fit
        A fit with a linear model.
    options
        How the gains are designed.
    reference
        What Q_M is judged by: a scenario (multisine, steps, sweep), a file `time_s,reference_nm`, a Series over time
        [s], or an array of rows (time, reference) or of one value a control sample.
    **keywords
        Fields of `TuneOptions`, each as above.

    Returns
    -------
    Gains
        With `rc`, `pi`, `guarantee`, `findings`, `to_frame()`, `save("gains.json")`.

    Raises
    ------
    GainsError
        The fit or the wishes are not physical, out of reach, or unstable on the linear model.
    UsageError
        Options that contradict one another.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> gains.rc.K_P, gains.rc.K_D
    (4.5, 3.0)
    >>> gains.guarantee.holds, "duty-limit" in gains.guarantee.missing
    (False, True)
    """
    from eaid.control.defaults import control_rate
    from eaid.replay.references import signal_of
    from eaid.replay.tune import tune

    fit, how = _result("fit", fit, Fit), chosen(TuneOptions, options, keywords)
    if reference is None or (isinstance(reference, str) and reference in TRACKED):
        return tune(fit, how, reference, reference or "")
    named = str(reference) if isinstance(reference, str | os.PathLike) else "as given"
    return tune(fit, how, signal_of(reference, 1 / (how.rate_hz or control_rate(fit))), named)


@taking(SimulateOptions)
def simulate(
    fit: "Fit | File",
    gains: "Gains | File | None" = None,
    scenario: str | None = None,
    options: SimulateOptions | None = None,
    *,
    controller: "str | OwnLaw | Sequence[str | OwnLaw] | None" = None,
    reference: "File | ArrayLike | pandas.Series[float] | Callable[[float], float] | None" = None,
    log: "Paths | None" = None,
    reading: ReadOptions | None = None,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Replay:
    """Replay controllers on the fitted plant from rest, or a log's own input.

    Parameters
    ----------
    fit
        A fit with a nonlinear model.
    gains
        Gains of `tune_rc`; controllers that need them are left out without.
    scenario : {"steps", "multisine", "sweep", "rehab"}, optional
        What is replayed; by itself multisine.
    options
        Scenario, controllers, rig and limb.
    controller
        Names, by themselves rc and pi, or controllers of your own: functions of time [s], reference and measured
        output that give the input, which is kept within the actuator's range.
    reference
        In place of a scenario: a file `time_s,reference_nm`, a Series over time [s], an array of rows (time,
        reference) or of one value a control sample, or a function of time [s], which lasts `duration`, 10 s by itself.
    log, reading
        Logs whose recorded input is replayed and compared, and how they are read.
    progress
        As in `read`.
    **keywords
        Fields of `SimulateOptions`, each as above.

    Returns
    -------
    Replay
        With `to_frame()` (time in s, reference and torque in N·m, duty in %; on other rigs in the rig's units),
        `plot()`, `findings`, `save("replay.h5")`.

    Raises
    ------
    DataError
        The fit holds no plant, or a log has other units than the fit.
    UsageError
        Options that do nothing here, or contradict one another.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> run = eaid.simulate(fit, gains, "multisine", noise_nm=0.01)
    >>> sorted(set(run.to_frame()["name"]))
    ['pi', 'rc']
    """
    from eaid.logs.read import read_like
    from eaid.replay.controllers import own_controllers
    from eaid.replay.simulate import simulate as replayed

    if isinstance(gains, str) and gains in SCENARIOS:
        raise UsageError(f"gains: {gains} is a «scenario»; give it by that name, or behind the gains")
    fit, gains = _result("fit", fit, Fit), None if gains is None else _result("gains", gains, Gains)
    names, own = own_controllers(controller)
    given = {"scenario": scenario, "controller": names}
    how = chosen(SimulateOptions, options, {k: v for k, v in given.items() if v is not None} | keywords)
    if sum(given is not None for given in (how.scenario, reference, log)) > 1:
        raise UsageError("«scenario», «reference» and «log» exclude each other; give one of them")
    if reading is not None and log is None:
        raise UsageError("«reading»: says how a «log» is read; give both or neither")
    if log is not None:
        how.check_for("log")
    runs = None if log is None else read_like(_paths(log), reading or ReadOptions(), fit.options.reading)
    return replayed(fit, gains, how, reference, runs, progress, own)


@taking(CoupleOptions)
def couple(
    fit: "Fit | File",
    gains: "Gains | File | None" = None,
    options: CoupleOptions | None = None,
    *,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Coupling:
    """How stiff a virtual wall each loop may render on a limb (Colgate and Schenkel 1997 for the sampled loop).

    Parameters
    ----------
    fit
        A fit with a nonlinear model, which is the plant.
    gains
        Gains of the loops rc and pi; without them the open loop and the inverse remain.
    options
        Limb, loop and torques.
    progress
        As in `read`.
    **keywords
        Fields of `CoupleOptions`, each as above.

    Returns
    -------
    Coupling
        With `walls` [N·m/rad], `impedance`, `to_frame()`, `findings`, `save("couple.json")`.

    Raises
    ------
    GainsError
        A loop is unstable without any wall.
    DataError
        The fit holds no plant.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> stiffness = eaid.couple(fit, gains, torque=(1.0,), loops=("pi", "rc"), replay=False)
    >>> [wall.loop for wall in stiffness.walls]
    ['pi', 'rc']
    """
    from eaid.coupling.couple import couple as walls

    fit, gains = _result("fit", fit, Fit), None if gains is None else _result("gains", gains, Gains)
    return walls(fit, gains, chosen(CoupleOptions, options, keywords), progress)


@taking(ReportOptions)
def report(
    *results: "Result | File | Sequence[Result | File]",
    to: "File | None" = None,
    options: ReportOptions | None = None,
    force: bool = False,
    **keywords: Any,
) -> Path:
    """Write one self-contained page, and the figures, of any results.

    Parameters
    ----------
    results
        Fits, gains, replays, steps, walls, or their files: one or several, also as a list.
    to
        Folder that is made where it is not there, its parent has to be; without it the last of `results` is that.
    options
        Which figures, and their formats.
    force
        Write over a report.
    **keywords
        Fields of `ReportOptions`, each as above.

    Returns
    -------
    Path
        The page, `to`/report.html; figures lie in `to`/figures.

    Raises
    ------
    UsageError
        The folder holds a report and `force` is not given, or an option names what is not there.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> page = eaid.report(fit, to=pathlib.Path(tempfile.mkdtemp()) / "report")
    >>> page.name
    'report.html'
    """
    from eaid.report.results import gathered
    from eaid.report.write import write_report

    how = chosen(ReportOptions, options, keywords)
    each: list[Any] = [one for some in results for one in (some if isinstance(some, list | tuple) else [some])]
    folder = each.pop() if to is None and each else to
    if not isinstance(folder, str | os.PathLike):
        raise UsageError("«to»: name the folder of the page, as report(fit, gains, to='report')")
    shown = [load(one) if isinstance(one, str | os.PathLike) else one for one in each]
    return write_report(gathered(shown), Path(folder), how, force)[0]


@taking(ExportOptions)
def export(
    gains: "Gains | File | None",
    output_dir: File = "export",
    fit: "Fit | File | None" = None,
    options: ExportOptions | None = None,
    *,
    force: bool = False,
    **keywords: Any,
) -> "ExportFolder":
    """Controllers and plant as source for a rig, with test vectors and a check program.

    Parameters
    ----------
    gains
        Gains of `tune_rc`; None: the fit's inverse and plant alone.
    output_dir
        Folder that is made; its parent has to be there.
    fit
        The plant of the laws `inverse` and `plant`.
    options
        Target, laws and timing.
    force
        Replace an earlier export.
    **keywords
        Fields of `ExportOptions`, each as above.

    Returns
    -------
    ExportFolder
        With `path`, `files`, `laws`, `dt_s`, `findings`.

    Raises
    ------
    GainsError
        A loop is unstable at the rate, or a finding of severity stop stands; `anyway` overrides, marked.
    UsageError
        Options that contradict one another, or a folder that is there already.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> folder = eaid.export(gains, pathlib.Path(tempfile.mkdtemp()) / "rig", target="yaml")
    >>> folder.laws, "parameters.yaml" in folder.files
    (('pi', 'rc'), True)
    """
    from eaid.export.export import export as exported

    gains = None if gains is None else _result("gains", gains, Gains)
    fit = None if fit is None else _result("fit", fit, Fit)
    return exported(gains, fit, chosen(ExportOptions, options, keywords), Path(output_dir), force)


def load(path: File) -> "Result | Rig | Comparison":
    """A result of any kind from its file, by what the file says of itself.

    Parameters
    ----------
    path
        A fit.json, gains.json, couple.json, rig.json, compare.json, replay.h5 or data.h5.

    Returns
    -------
    Fit or Gains or Coupling or Rig or Comparison or Replay or StepSet
        The result, with units as the file has them.

    Raises
    ------
    DataError
        No such file, a file that is no result of eaid, or one that was changed after it was written.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "fit.json"
    >>> fit.save(file)
    >>> eaid.load(file).params.equals(fit.params)
    True
    """
    from eaid.report.results import read_result

    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"path: is a {type(path).__name__}; give the file of a result")
    result: Result | Rig | Comparison = read_result(Path(path))[0]
    return result


@taking(SessionsOptions)
def sessions(
    data: "pandas.DataFrame | Mapping[str, Fit] | Sequence[Fit] | Paths",
    options: SessionsOptions | None = None,
    **keywords: Any,
) -> "Rig":
    """Several sessions of one rig, and what its next one may be.

    Parameters
    ----------
    data
        Three fits and more, in their order (by name, in a list, or as files); or a table, or a file of one, with the
        columns session, level, value and sd_log, the standard deviation of the value's logarithm.
    options
        How they are held together.
    **keywords
        Fields of `SessionsOptions`: reference_level, terms.

    Returns
    -------
    Rig
        With `next()`, `today(step)`, `summary()`, `plot()`, `to_frame()`, `findings`, `save("rig.json")`.

    Raises
    ------
    DataError
        Fewer than three sessions, fits of different rigs, a log in two of them, or a table that is none.
    UsageError
        More terms than the sessions carry.

    Examples
    --------
    >>> import eaid, pandas
    >>> held = {"mon": (0.11, 0.40), "tue": (0.12, 0.26), "wed": (0.15, 0.33), "thu": (0.10, 0.21)}
    >>> rows = [(day, level, value) for day, both in held.items() for level, value in zip((150, 200), both)]
    >>> frame = pandas.DataFrame(rows, columns=["session", "level", "value"]).assign(sd_log=0.05)
    >>> rig = eaid.sessions(frame, reference_level=200.0)
    >>> rig.next([200.0]).round(2).loc[200.0].tolist()
    [0.29, 0.13, 0.66, 3.0]
    >>> step = pandas.DataFrame({"level": [150.0], "value": [0.12]})
    >>> bool(rig.next([200.0], steps=step).high[200.0] < rig.next([200.0]).high[200.0])
    True
    """
    from eaid.sessions.gather import read_sessions, table_values
    from eaid.sessions.rig import rig_of_fits, rig_of_table

    how = chosen(SessionsOptions, options, keywords)
    if hasattr(data, "columns"):
        return rig_of_table(table_values(data), how)  # type: ignore[arg-type]
    if isinstance(data, Mapping):
        return rig_of_fits(data, how)
    if isinstance(data, Sequence) and data and all(isinstance(one, Fit) for one in data):
        return rig_of_fits({f"session {k}": one for k, one in enumerate(data, 1)}, how)
    fits, values, _ = read_sessions(_paths(data))
    return rig_of_table(values, how) if values else rig_of_fits(fits, how)


def today(
    rig: "Rig | File",
    step: "Fit | StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    reading: ReadOptions | None = None,
    *,
    progress: Progress = no_progress,
) -> Fit:
    """One or two reference steps of a new session → a fit whose intervals hold for it.

    Parameters
    ----------
    rig
        What `sessions` returns, of fits, or its file.
    step
        Steps from rest of today: what `read` takes or returns, or a fit of them.
    reading
        How logs are read, where it is not as the logs of the sessions were.
    progress
        As in `read`.

    Returns
    -------
    Fit
        As of any other session, for `tune_rc`, `simulate`, `couple`, `export` and `report`; drawn plants, B_m and B_M
        are those of the next session given these steps.

    Raises
    ------
    DataError
        A rig of a plain table, steps of another rig or of one of its sessions, or none whose output rises.
    """
    from eaid.sessions.rig import Rig
    from eaid.sessions.today import reading_of
    from eaid.sessions.today import today as fit_today

    rig = _result("rig", rig, Rig)
    if not isinstance(step, Fit | StepSet):
        step = read(step, reading_of(rig, reading), progress=progress)
    return fit_today(rig, step)


@taking(CompareOptions)
def compare(
    first: "Fit | Replay | File",
    *others: "Fit | Paths",
    gains: "Gains | File | None" = None,
    reading: ReadOptions | None = None,
    names: Sequence[str] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ",
    options: CompareOptions | None = None,
    **keywords: Any,
) -> "Comparison":
    """What moved between sessions; or whether a recorded loop does what its fit and gains promise.

    Parameters
    ----------
    first
        The fit in question; or, of a recorded loop, the fit or the replay that promised it.
    *others
        Fits of other sessions that it is held against; or the log of a loop, with the reference among its columns.
    gains
        Gains: must they be made anew; of a recorded loop those that it ran with.
    reading
        How the log of a loop is read; by itself as the logs of the fit.
    names
        What the sessions are called beside their letters A, B, C.
    options
        How a recorded loop is held against its promise.
    **keywords
        Fields of `CompareOptions`: controller, plants, seed.

    Returns
    -------
    Comparison
        With `shifts`, `retune`, `promise`, `summary()`, `plot()`, `to_frame()`, `save("compare.json")`.

    Raises
    ------
    DataError
        Fits of different rigs or without a level in common, or a log without a reference.
    UsageError
        Nothing to compare with.

    Examples
    --------
    >>> import eaid
    >>> week, now = (eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=k)) for k in (4, 5))
    >>> found = eaid.compare(now, week, gains=eaid.tune_rc(week))
    >>> found.changed, found.retune.needed
    (False, False)
    """
    from eaid.logs.read import read_like
    from eaid.sessions.compare import Comparison, compare_fits

    how = chosen(CompareOptions, options, keywords)
    first, gains = _held(first), None if gains is None else _result("gains", gains, Gains)
    others = tuple(_held(one) if str(one).endswith(".json") else one for one in others)
    if not isinstance(first, Fit | Replay):
        raise UsageError(f"first: is a {type(first).__name__}; give a fit or a replay, or its file")
    if not others:
        raise UsageError("one result alone: give another session's fit, or the log of a loop, to compare it with")
    if isinstance(first, Fit) and all(isinstance(one, Fit) for one in others):
        named = dict(zip(names, (first, *others), strict=False))
        if len(named) <= len(others):
            raise UsageError(f"{len(others) + 1} sessions and {len(set(names))} names; give each one of its own")
        return compare_fits(named, gains, how)  # type: ignore[arg-type]
    from eaid.sessions.loop import promise_of

    fit, given = (first, None) if isinstance(first, Fit) else (None, first)
    as_fitted = fit.options.reading if fit is not None else {}
    runs = read_like(_paths(others[0]), reading or ReadOptions(), as_fitted)
    if len(runs) != 1 or len(others) != 1:
        raise UsageError("a recorded loop is one log with its own reference; give one")
    promise = promise_of(runs[0], how, fit, gains, given)
    return Comparison(options=how, output_unit=promise.unit, promise=promise)


def plot(result: "Fit | Gains | Replay | Rig | Comparison", ax: Any = None) -> Any:
    """A result on matplotlib Axes: the step responses of a fit, margins of gains over the input, traces of a replay,
    the control chart of a rig, T_s of sessions that are compared.

    Parameters
    ----------
    result
        A fit, gains, a replay, a rig or a comparison.
    ax
        Axes that are drawn on; without them new ones. Or `"residuals"`, of a fit: what it leaves over time, with itself
        a lag later, and against the input, on three new Axes.

    Returns
    -------
    matplotlib.axes.Axes or array of them
        The Axes, labelled with units.

    Raises
    ------
    UsageError
        Something else in place of a result or of Axes.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> eaid.plot(fit).get_xlabel()
    'Time since the step (s)'
    """
    from eaid.report.paper import plot as drawn
    from eaid.report.paper import plot_residuals
    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig

    if not isinstance(result, Fit | Gains | Replay | Rig | Comparison):
        raise UsageError(f"result: is a {type(result).__name__}; give a fit, gains or a replay")
    if isinstance(result, Fit) and isinstance(ax, str) and ax == "residuals":
        return plot_residuals(result)
    if ax is not None and not hasattr(ax, "plot"):
        raise UsageError(f"«ax» {ax!r:.40}: is no matplotlib Axes; leave it out, or give one of plt.subplots()")
    return drawn(result, ax)


def _tables(source: Any) -> "pandas.DataFrame | Mapping[str, pandas.DataFrame] | None":
    """DataFrames in memory as `runs_from_frames` takes them; None: paths."""
    if hasattr(source, "columns"):
        return source  # type: ignore[no-any-return]
    if isinstance(source, Mapping):
        for name, one in source.items():
            if one is None or isinstance(one, str):
                raise DataError(f"{name}: is no DataFrame and no array")
        if any(hasattr(one, "columns") or isinstance(one, Mapping) for one in source.values()):
            return {name: one if hasattr(one, "columns") else _frame(one) for name, one in source.items()}
        return _frame(source)
    if isinstance(source, list | tuple) and source and all(hasattr(one, "columns") for one in source):
        return {f"run {k}": one for k, one in enumerate(source, 1)}
    return None


def _frame(columns: Any) -> "pandas.DataFrame":
    """Arrays by the names of their columns as one table; DataError where they are none, or of several lengths."""
    import pandas

    try:
        return pandas.DataFrame({name: numpy.ravel(one) for name, one in columns.items()})
    except (AttributeError, ValueError):
        found = (f"{name} of {numpy.size(one)}" for name, one in columns.items()) if hasattr(columns, "items") else ()
        said = ", ".join(found) or f"a {type(columns).__name__}"
        raise DataError(f"arrays by column: {said}; give as many values of time, input and output") from None


def _measured(data: Any, arrays: Sequence[Any], options: FitOptions | None) -> tuple[Any, FitOptions | None]:
    """What `fit` was given by place: data and options, or time, input and output."""
    if arrays and isinstance(arrays[-1], FitOptions):
        *arrays, options = arrays
    if not arrays:
        return data, options
    if len(arrays) != 2 or any(isinstance(one, str) for one in (data, *arrays)):
        raise UsageError("fit takes logs, or time, input and output as arrays; give FitOptions, or keywords")
    return dict(zip(("time_s", "input", "output"), (data, *arrays), strict=True)), options


def _paths(source: Any) -> list[Path]:
    """One path or several as a list."""
    try:
        each = [source] if isinstance(source, str | os.PathLike) else list(source)
        if any(isinstance(one, str) and one == "" for one in each):
            raise UsageError("an empty path: give a file or a folder")
        return [Path(one) for one in each]
    except TypeError:
        shown = repr(source) if isinstance(source, int | float | None) else f"a {type(source).__name__}"
        raise UsageError(f"{shown}: give files or folders of logs, a DataFrame, or DataFrames by name") from None


def _held(value: Any) -> Any:
    """A result, or what its file holds."""
    return load(value) if isinstance(value, str | os.PathLike) else value


def _result(name: str, value: Any, kind: type[T]) -> T:
    """A result of a kind, or what its file holds."""
    found = _held(value)
    if not isinstance(found, kind):
        said = f"{value} holds {type(found).__name__}" if found is not value else f"is a {type(value).__name__}"
        made = {"Gains": "eaid.tune_rc", "Rig": "eaid.sessions"}.get(kind.__name__, "eaid.fit")
        raise UsageError(f"{name}: {said}; give what {made} returns, or its file")
    return found
