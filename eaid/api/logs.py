"""Logs → steps: recorded ones, and synthetic ones of a plant."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from eaid.api.given import Paths, chosen, paths_of
from eaid.logs.frames import runs_from_frames
from eaid.progress import Progress, no_progress
from eaid.reading import InputOptions, read_steps, steps_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    import pandas


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
    how = chosen(InputOptions, None, {**({"columns": columns} if columns else {}), **options})
    if hasattr(source, "columns") or isinstance(source, Mapping):
        return steps_of(runs_from_frames(source, how.reading()), how, whole=logs_as)[1]  # type: ignore[arg-type]
    return read_steps(paths_of(source), how, progress, whole=logs_as)[1]


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

    asked = chosen(SynthOptions, None, options)
    runs = synthesize(asked, plant, gains=gains)
    return steps_of(runs, InputOptions(), whole="auto" if asked.duty_file or asked.excitation else "steps")[1]
