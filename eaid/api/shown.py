"""Results: from their files, on a page, on Axes, over the sessions of a rig, against one another."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eaid.api.given import AnyResult, File, GivenTables, Paths, as_result, logs_in, paths_in, result_of
from eaid.api.models import read
from eaid.declared import given_options, taking
from eaid.errors import UsageError
from eaid.options import CompareOptions, ReadOptions, ReportOptions, SessionsOptions
from eaid.progress import Progress, no_progress
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    import pandas

    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig


def load(path: File) -> "AnyResult | Rig | Comparison":
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
    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"path: is a {type(path).__name__}; give the file of a result")
    result: AnyResult | Rig | Comparison = as_result(path)
    return result


@taking(ReportOptions)
def report(
    *results: "AnyResult | File | Sequence[AnyResult | File]",
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

    how = given_options(ReportOptions, options, keywords)
    each: list[Any] = [one for some in results for one in (some if isinstance(some, list | tuple) else [some])]
    folder = each.pop() if to is None and each else to
    if not isinstance(folder, str | os.PathLike):
        raise UsageError("«to»: name the folder of the page, as report(fit, gains, to='report')")
    return write_report(gathered(list(map(as_result, each))), Path(folder), how, force)[0]


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
    from eaid.report.paper import plot_residuals
    from eaid.report.paper import plot_result as drawn
    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig

    if not isinstance(result, Fit | Gains | Replay | Rig | Comparison):
        raise UsageError(f"result: is a {type(result).__name__}; give a fit, gains or a replay")
    if isinstance(result, Fit) and isinstance(ax, str) and ax == "residuals":
        return plot_residuals(result)
    if isinstance(ax, str):
        raise UsageError(f"«ax» {ax!r:.40}: is no drawing; 'residuals', of a fit, is the only one that has a name")
    if ax is not None and not hasattr(ax, "plot"):
        raise UsageError(f"«ax» {ax!r:.40}: is no matplotlib Axes; leave it out, or give one of plt.subplots()")
    return drawn(result, ax)


@taking(SessionsOptions)
def sessions(
    data: "pandas.DataFrame | Mapping[str, Fit] | Sequence[Fit] | Fit | Paths",
    *more: "Fit | File",
    options: SessionsOptions | None = None,
    **keywords: Any,
) -> "Rig":
    """Several sessions of one rig, and what its next one may be.

    Parameters
    ----------
    data
        Three fits and more, in their order (by name, in a list, or as files); or a table, or a file of one, with the
        columns session, level, value and sd_log, the standard deviation of the value's logarithm.
    *more
        The other fits, where `data` is the first of them.
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

    how = given_options(SessionsOptions, options, keywords)
    if hasattr(data, "columns"):
        return rig_of_table(table_values(data), how)  # type: ignore[arg-type]
    if isinstance(data, Mapping):
        return rig_of_fits(data, how)
    each = [data, *more] if more or isinstance(data, Fit) else data
    if isinstance(each, Sequence) and any(isinstance(one, Fit) for one in each):
        named = {f"session {k}": one for k, one in enumerate(each, 1)}
        return rig_of_fits({name: result_of(name, one, Fit) for name, one in named.items()}, how)
    fits, values, _ = read_sessions(paths_in(each))
    return rig_of_table(values, how) if values else rig_of_fits(fits, how)


def today(
    rig: "Rig | File",
    step: "Fit | StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    reading: ReadOptions | None = None,
    *,
    progress: "Progress" = no_progress,
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

    rig = result_of("rig", rig, Rig)
    if not isinstance(step, Fit | StepSet):
        step = read(step, reading_of(rig, reading), progress=progress)
    return fit_today(rig, step)


@taking(CompareOptions)
def compare(
    first: "Fit | Replay | File",
    *others: "Fit | Paths | GivenTables",
    gains: "Gains | File | None" = None,
    reading: ReadOptions | None = None,
    names: Sequence[str] | None = None,
    options: CompareOptions | None = None,
    **keywords: Any,
) -> "Comparison":
    """What moved between sessions; or whether a recorded loop does what its fit and gains promise.

    Parameters
    ----------
    first
        The fit in question; or, of a recorded loop, the fit or the replay that promised it.
    *others
        Fits of other sessions that it is held against; or the log of a loop, a file or a DataFrame, with its reference.
    gains
        Gains: must they be made anew; of a recorded loop those that it ran with.
    reading
        How the log of a loop is read; by itself as the logs of the fit.
    names
        What the sessions are called beside their letters A, B, C; by themselves as their files, «session A» of a fit.
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
    from eaid.sessions.compare import LETTERS, Comparison, compare_fits

    how = given_options(CompareOptions, options, keywords)
    asked = [first, *others]
    gains = None if gains is None else result_of("gains", gains, Gains)
    first, others = as_result(first), tuple(as_result(one) if str(one).endswith(".json") else one for one in others)
    if not isinstance(first, Fit | Replay):
        raise UsageError(f"first: is a {type(first).__name__}; give a fit or a replay, or its file")
    if not others:
        raise UsageError("one result alone: give another session's fit, or the log of a loop, to compare it with")
    if isinstance(first, Fit) and all(isinstance(one, Fit) for one in others):
        if names is None:
            letters = zip(LETTERS, asked, strict=False)
            names = [f"session {letter}" if isinstance(one, Fit) else str(one) for letter, one in letters]
        named = dict(zip(names, (first, *others), strict=False))
        if len(named) <= len(others):
            twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
            told = f"{len(others) + 1} sessions have {len(names)} names; give each its own"
            raise UsageError(told if twice is None else f"{twice}: is given twice; give another session's fit")
        return compare_fits(named, gains, how)  # type: ignore[arg-type]
    from eaid.sessions.loop import promise_of

    fit, given = (first, None) if isinstance(first, Fit) else (None, first)
    as_fitted = fit.options.reading if fit is not None else {}
    runs = read_like(logs_in(others[0]), reading or ReadOptions(), as_fitted)
    if len(runs) != 1 or len(others) != 1:
        raise UsageError("a recorded loop is one log with its own reference; give one")
    promise = promise_of(runs[0], how, fit, gains, given)
    return Comparison(options=how, output_unit=promise.unit, promise=promise)
