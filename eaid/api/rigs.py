"""Several sessions of one rig, today's, and what moved between them."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from eaid.api.given import File, Paths, held, paths_in, result_of
from eaid.api.models import read
from eaid.declared import chosen, taking
from eaid.errors import UsageError
from eaid.options import CompareOptions, ReadOptions, SessionsOptions
from eaid.progress import Progress, no_progress
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    import pandas

    from eaid.sessions.compare import Comparison
    from eaid.sessions.rig import Rig


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
    fits, values, _ = read_sessions(paths_in(data))
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

    rig = result_of("rig", rig, Rig)
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
    first, gains = held(first), None if gains is None else result_of("gains", gains, Gains)
    others = tuple(held(one) if str(one).endswith(".json") else one for one in others)
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
    runs = read_like(paths_in(others[0]), reading or ReadOptions(), as_fitted)
    if len(runs) != 1 or len(others) != 1:
        raise UsageError("a recorded loop is one log with its own reference; give one")
    promise = promise_of(runs[0], how, fit, gains, given)
    return Comparison(options=how, output_unit=promise.unit, promise=promise)
