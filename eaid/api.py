"""The public functions: logs → steps → fit → gains → replay → page, each a call with typed options and results.

The commands call the same functions. A function takes its options whole (`eaid.FitOptions(...)`) or one by one as
keywords; `eaid.options` declares them.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from eaid.declared import chosen
from eaid.errors import UsageError
from eaid.estimate.workflow import fit_steps
from eaid.logs.frames import runs_from_frames
from eaid.options import (
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
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.parameters import table_of
from eaid.results.plan import Excitation, Plan
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    import pandas

    from eaid.export.export import ExportFolder
    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig

Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]
Column = str | int | None


def read(
    source: "Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
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
        Files or folders of logs, a data.h5, a DataFrame (with a column `run` where it holds several), or a mapping of
        run name to DataFrame.
    options
        How the logs are read and cut.
    time, input, output
        Columns by name or number from 1, where they are not found by themselves.
    progress
        `progress(what, how_many)` gives a context with a function to call once a piece.
    **keywords
        Fields of `ReadOptions`: units, name_pattern, step_at [s], until [s], baseline, rest, repair, kind, logs_as, …

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
    if hasattr(source, "columns") or isinstance(source, Mapping):
        return steps_of(runs_from_frames(source, how), how)[1]  # type: ignore[arg-type]
    return read_steps(_paths(source), how, progress)[1]


def fit(
    data: "StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    options: FitOptions | None = None,
    *,
    progress: Progress = no_progress,
    **keywords: Any,
) -> Fit:
    """Fit the models of the paper to recorded steps, Eqs. (3) to (8), with intervals and a verdict.

    Parameters
    ----------
    data
        What `read` returns, or anything that `read` takes.
    options
        How it is fitted.
    progress
        As in `read`.
    **keywords
        Fields of `FitOptions`: model, share, loss, hold_out, bounds_levels, estimator, ci, duty, …

    Returns
    -------
    Fit
        With `summary()`, `params`, `conf_int()`, `to_frame()`, `predict()`, `plot()`, `findings`, `save("fit.json")`.
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
    how = chosen(FitOptions, options, keywords)
    steps = data if isinstance(data, StepSet) else read(data, progress=progress)
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
    fitted = msgspec.structs.replace(fitted, parameters=table_of(fitted))
    fitted.__dict__["steps_fitted"] = steps
    return fitted


def plan(
    fit: Fit,
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
        Fields of `PlanOptions`: want [%], check, seed; of steps idle_s, release_s, longest_hold_s, most_levels; of a
        sequence limits.

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

    _of_type("fit", fit, Fit)
    how = chosen(PlanOptions, options, keywords)
    with progress("simulated recordings", 0) as advance:
        return (shortest_recording if excitation else plan_recordings)(fit, how, advance)


def synth(plant: Fit | None = None, options: SynthOptions | None = None, **keywords: Any) -> StepSet:
    """Synthetic logs of the reference plant, or of a fitted rig in its own units.

    Parameters
    ----------
    plant
        A fit; without one the paper's clutch, or the friction rig of `kind`.
    options
        Levels, times, disturbances, or an input in place of steps.
    **keywords
        Fields of `SynthOptions`: levels, repeats, idle_s, hold_s, release_s, rate_hz, seed, clean, white_nm, …; in
        place of steps duty_file or excitation ("random", "staircase", "chirp", "closed-loop")
        with its shape (duration_s, duty, hold_s, levels, …).

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
    runs = synthesize(how, plant)
    return steps_of(runs, ReadOptions(logs_as="auto" if how.duty_file or how.excitation else "steps"))[1]


def tune_rc(
    fit: Fit,
    options: TuneOptions | None = None,
    *,
    reference: "str | os.PathLike[str] | None" = None,
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
        A scenario (multisine, steps, sweep), or a file `time_s,reference_nm`, which Q_M is judged by.
    **keywords
        Fields of `TuneOptions`: kp [1/s²], kd [1/s], b_hat, rho, phi, pi_overshoot [%], pi_settling [s], …

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
    from eaid.options import TRACKED
    from eaid.replay.references import read_reference
    from eaid.replay.tune import tune

    _of_type("fit", fit, Fit)
    named = "" if reference is None else str(reference)
    signal = (named or None) if reference is None or named in TRACKED else read_reference(Path(reference))
    return tune(fit, chosen(TuneOptions, options, keywords), signal, named)


def simulate(
    fit: Fit,
    gains: Gains | None = None,
    scenario: str | None = None,
    options: SimulateOptions | None = None,
    *,
    reference: "str | os.PathLike[str] | None" = None,
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
    reference
        A file `time_s,reference_nm` in place of a scenario.
    log, reading
        Logs whose recorded input is replayed and compared, and how they are read.
    progress
        As in `read`.
    **keywords
        Fields of `SimulateOptions`: noise_nm [N·m], pwm_hz [Hz], delay_samples, plants, …

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
    from eaid.replay.references import read_reference
    from eaid.replay.simulate import simulate as replayed

    _of_type("fit", fit, Fit)
    how = chosen(SimulateOptions, options, {**({} if scenario is None else {"scenario": scenario}), **keywords})
    if sum(given is not None for given in (how.scenario, reference, log)) > 1:
        raise UsageError("«scenario», «reference» and «log» exclude each other; give one of them")
    if reading is not None and log is None:
        raise UsageError("«reading»: says how a «log» is read; give both or neither")
    signal = None if reference is None else read_reference(Path(reference))
    if log is not None:
        how.check_for("log")
    rate = fit.options.reading.get("rate_hz")
    rate_hz = rate if isinstance(rate, float) else None
    runs = None if log is None else read_like(_paths(log), reading or ReadOptions(), rate_hz)
    return replayed(fit, gains, how, signal, runs, progress)


def couple(
    fit: Fit,
    gains: Gains | None = None,
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
        Fields of `CoupleOptions`: limb_inertia [kg·m²], limb_damping [N·m·s/rad], torque [N·m], pwm_hz, …

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

    _of_type("fit", fit, Fit)
    return walls(fit, gains, chosen(CoupleOptions, options, keywords), progress)


def report(
    results: Fit | Gains | Replay | StepSet | Coupling | Sequence[Fit | Gains | Replay | StepSet | Coupling],
    output_dir: str | os.PathLike[str],
    options: ReportOptions | None = None,
    *,
    force: bool = False,
    **keywords: Any,
) -> Path:
    """Write one self-contained page, and the figures, of any results.

    Parameters
    ----------
    results
        Fits, gains, replays, steps, walls: one or several.
    output_dir
        Folder that is made where it is not there; its parent has to be.
    options
        Which figures, and their formats.
    force
        Write over a report.
    **keywords
        Fields of `ReportOptions`: figures, format.

    Returns
    -------
    Path
        The page, `output_dir`/report.html; figures lie in `output_dir`/figures.

    Raises
    ------
    UsageError
        The folder holds a report and `force` is not given, or an option names what is not there.

    Examples
    --------
    >>> import eaid, pathlib, tempfile
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> page = eaid.report([fit], pathlib.Path(tempfile.mkdtemp()) / "report")
    >>> page.name
    'report.html'
    """
    from eaid.report.results import gathered
    from eaid.report.write import write_report

    given = gathered(results if isinstance(results, Iterable) else [results])
    return write_report(given, Path(output_dir), chosen(ReportOptions, options, keywords), force)[0]


def export(
    gains: Gains | None,
    output_dir: "str | os.PathLike[str]" = "export",
    fit: Fit | None = None,
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
        Fields of `ExportOptions`: target, law, precision, rate_hz [Hz], duty_on_fault, …

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

    return exported(gains, fit, chosen(ExportOptions, options, keywords), Path(output_dir), force)


def load(path: str | os.PathLike[str]) -> "Fit | Gains | Coupling | Replay | StepSet | Rig | Comparison":
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

    result: Fit | Gains | Coupling | Replay | StepSet | Rig | Comparison = read_result(Path(path))[0]
    return result


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
    fits, values, _ = read_sessions(_paths(data))  # type: ignore[arg-type]
    return rig_of_table(values, how) if values else rig_of_fits(fits, how)


def today(
    rig: "Rig",
    step: "Fit | StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    reading: ReadOptions | None = None,
    *,
    progress: Progress = no_progress,
) -> Fit:
    """One or two reference steps of a new session → a fit whose intervals hold for it.

    Parameters
    ----------
    rig
        What `sessions` returns, of fits.
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
    from eaid.sessions.today import today as fit_today

    return fit_today(rig, step, reading, progress)


def compare(
    first: "Fit | Replay",
    *others: "Fit | Paths",
    gains: Gains | None = None,
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
    from eaid.logs.read import read_runs
    from eaid.sessions.compare import Comparison, compare_fits

    how = chosen(CompareOptions, options, keywords)
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
    how_read = reading or chosen(ReadOptions, None, {k: v for k, v in as_fitted.items() if k in ("columns", "units")})
    runs = read_runs(_paths(others[0]), how_read)  # type: ignore[arg-type]
    if len(runs) != 1 or len(others) != 1:
        raise UsageError("a recorded loop is one log with its own reference; give one")
    promise = promise_of(runs[0], how, fit, gains, given)
    return Comparison(options=how, output_unit=promise.unit, promise=promise)


def _paths(source: Paths) -> list[Path]:
    """One path or several as a list."""
    try:
        each = [source] if isinstance(source, str | os.PathLike) else list(source)
        if any(str(one) == "" for one in each):
            raise UsageError("an empty path: give a file or a folder")
        return [Path(one) for one in each]
    except TypeError:
        shown = " ".join(repr(source).split())
        raise UsageError(f"{shown:.60}: give files or folders of logs, a DataFrame, or DataFrames by name") from None


def _of_type(name: str, value: object, kind: type) -> None:
    if not isinstance(value, kind):
        raise UsageError(f"{name}: is a {type(value).__name__}; give what eaid.{name} returns")
