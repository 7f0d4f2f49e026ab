"""Logs → steps → fit, and what to record next."""

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import msgspec

from eaid.api.given import File, GivenTables, OneColumn, Paths, given_data, paths_in, result_of, tables_in
from eaid.arrays import median
from eaid.declared import forms, given_options, taking
from eaid.errors import DataError, UsageError
from eaid.findings import say
from eaid.options import FitOptions, PlanOptions, ReadOptions, SynthOptions
from eaid.progress import Progress, no_progress
from eaid.reading import read_steps, steps_in
from eaid.results.fit import Fit
from eaid.results.plan import Excitation, Plan
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


# Times by which a plant may explain the logs of its steps worse than these, and scatter of ln τ1 that no clutch has
WORSE_PLAYED, RUNS_APART = 1.7, 0.3
MOST_RUNS_LEFT_OUT = 0.2  # Part of the runs that spikes may leave out before it is asked what to do with them


@taking(ReadOptions)
def read(
    source: "Paths | GivenTables",
    options: ReadOptions | None = None,
    *,
    time: OneColumn = None,
    input: OneColumn = None,
    output: OneColumn = None,
    progress: "Progress" = no_progress,
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
    how = given_options(ReadOptions, options, {**({"columns": columns} if columns else {}), **keywords})
    tables = tables_in(source)
    if tables is not None:
        from eaid.logs.read import runs_from_frames

        return steps_in(runs_from_frames(tables, how), how)[1]
    return read_steps(paths_in(source), how, progress)[1]


@taking(FitOptions)
def fit(
    data: "StepSet | Paths | GivenTables | ArrayLike",
    *arrays: "ArrayLike | FitOptions",
    options: FitOptions | None = None,
    progress: "Progress" = no_progress,
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
    source, options = given_data(data, arrays, options)
    if of_reading := [name for name in keywords if name in forms(ReadOptions) and name not in forms(FitOptions)]:
        raise UsageError(
            f"«{of_reading[0]}»: says how logs are read; give it to eaid.read, and what that returns to fit"
        )
    how = given_options(FitOptions, options, keywords)
    steps = source if isinstance(source, StepSet) else read(source, progress=progress)
    _ask(steps)
    from eaid.levels.asks import asks_for_another_kind
    from eaid.levels.tails import as_fitted
    from eaid.levels.workflow import fit_steps, tell_within_row
    from eaid.replay.compare import of_own_logs, residuals_of_logs
    from eaid.results.common import Samples
    from eaid.results.parameters import parameters_of
    from eaid.results.responses import responses_of
    from eaid.results.verdict import judged

    steps = steps.as_recorded if how.duty is not None and steps.swept else steps
    if how.duty is not None and not steps.recorded:
        raise UsageError("«duty»: belongs to logs that are fitted as recorded, and these are steps; leave it out")
    refits = how.draws if how.ci == "bootstrap" else 0
    if not steps.recorded:
        with progress("bootstrap refits" if refits else "fitting", refits) as advance:
            fitted = as_clutch = fit_steps(steps, how, advance)
        another = asks_for_another_kind(as_clutch)
        if steps.swept and _tells_tails_wrongly(as_clutch, steps, another):
            steps = steps.as_recorded
    if steps.recorded:
        from eaid.recorded.fit import fit_whole

        with progress("fitting the recorded log", 0):
            fitted = tell_within_row(fit_whole(steps, how))
        samples = Samples(steps, partial(residuals_of_logs, runs=steps.recorded))
        return msgspec.structs.replace(fitted, parameters=parameters_of(fitted), samples=samples)
    if another:
        with progress("fitting other kinds of plant", 0):
            from eaid.recorded.another_kind import try_another_kind

            fitted = try_another_kind(as_clutch, steps, how)
    of_data = msgspec.structs.replace(fitted.data, replayed=of_own_logs(fitted, steps.logs))
    fitted = judged(tell_within_row(msgspec.structs.replace(fitted, data=of_data)))
    steps = as_fitted(steps, fitted)
    responses = responses_of(steps.noted_late(fitted.noted_late_s), as_clutch.findings)
    more = {"responses": responses, "parameters": parameters_of(fitted), "samples": Samples(steps)}
    return msgspec.structs.replace(fitted, **more)


def _tells_tails_wrongly(as_clutch: Fit, steps: StepSet, another: bool) -> bool:
    """Whether steps begin on what those before have left, and the clutch's form does not tell that: it does not hold,
    leaves steps out, or plays the logs again far worse than it explains their steps, and their gains scatter."""
    from eaid.levels.tails import begin_off_rest
    from eaid.replay.compare import of_own_logs

    if not (as_clutch.on_tails or any(run.swept for run in steps.steps) or (another and begin_off_rest(steps))):
        return False
    left_out = any(one.code == "levels-left-out" for one in as_clutch.findings)
    if another or left_out or any(run.left_out for run in steps.runs):
        return True
    left = [100 - one.fit_pct for one in of_own_logs(as_clutch, steps.logs) if one.fit_pct is not None]
    fit_pct = None if as_clutch.nonlinear is None else as_clutch.nonlinear.fit_pct
    if not left or fit_pct is None or as_clutch.uncertainty is None or as_clutch.uncertainty.noise is None:
        return False
    scatter = as_clutch.uncertainty.noise.scatter
    expected = math.hypot(100 - fit_pct, 100 * scatter["Ts"])
    return median(left) > WORSE_PLAYED * expected or scatter["tau1"] > RUNS_APART


def _ask(steps: StepSet) -> None:
    """DataError for logs that no fit holds with before one reading option more is given."""
    found = {one.code: one for one in steps.all_findings}
    left_out = [one for run in steps.runs if run.left_out for one in run.findings if one.code == "spikes"]
    if len(left_out) > MOST_RUNS_LEFT_OUT * len(steps.runs):
        found["spikes"] = left_out[0]
    assumed = found.get("unit-assumed")
    asked = (
        found.get("spikes") if not steps.reading.get("repair") else None,
        found.get("duty-may-be-fraction") if assumed is not None and assumed.values["role"] == "input" else None,
    )
    if faults := [f"{one.subject}: " * (one.subject != "data") + say(one) for one in asked if one is not None]:
        raise DataError(*faults)


@taking(PlanOptions)
def plan(
    fit: "Fit | File",
    options: PlanOptions | None = None,
    *,
    excitation: bool = False,
    progress: "Progress" = no_progress,
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

    fit = result_of("fit", fit, Fit)
    how = given_options(PlanOptions, options, keywords)
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

    how = given_options(SynthOptions, options, keywords)
    runs = synthesize(how, None if plant is None else result_of("plant", plant, Fit))
    return steps_in(runs, ReadOptions(logs_as="auto" if how.duty_file or how.excitation else "steps"))[1]
