"""Steps → fit, and fit → what to record next."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from eaid.api.given import Paths, chosen
from eaid.api.logs import read
from eaid.errors import UsageError
from eaid.progress import Progress, no_progress
from eaid.results.fit import Fit, FitOptions
from eaid.results.plan import Plan
from eaid.results.recorded import Excitation
from eaid.steps.levels import wanted_levels
from eaid.steps.stepset import StepSet
from eaid.uncertainty.workflow import fit_steps

if TYPE_CHECKING:
    import pandas

    from eaid.planning.excitation import ExcitationOptions
    from eaid.planning.recordings import PlanOptions


def fit(
    data: "StepSet | Paths | pandas.DataFrame | Mapping[str, pandas.DataFrame]",
    options: FitOptions | None = None,
    *,
    progress: Progress = no_progress,
    bounds_levels: "str | Sequence[float] | None" = None,
    duty: tuple[float, float] | None = None,
    instrument: bool = False,
    **keywords: Any,
) -> Fit:
    """Fit the models of the paper to recorded steps, with intervals and a verdict.

    Parameters
    ----------
    data
        What `read` returns, or anything that `read` takes.
    options
        All choices at once; single ones as keywords: models, share, loss, hold_out, estimator, ci, …
    progress
        As in `read`.
    bounds_levels
        Levels over which B_m and B_M are taken, as numbers or as "20:100".
    duty, instrument
        Of logs that are fitted as they were recorded: identified inputs, and the simulated duty as an instrument.

    Returns
    -------
    Fit
        With `summary()`, `params`, `conf_int()`, `to_frame()`, `predict()`, `plot()`, `findings`, `save("fit.json")`.

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
    asked = chosen(FitOptions, options, keywords)
    steps = data if isinstance(data, StepSet) else read(data, progress=progress)
    if bounds_levels is not None:
        text = bounds_levels if isinstance(bounds_levels, str) else ",".join(f"{u:.17g}" for u in bounds_levels)
        kept = wanted_levels(text, [level.level for level in steps.levels], "bounds_levels")
        asked = msgspec.structs.replace(asked, bounds_levels=tuple(kept))
    if steps.recorded:
        from eaid.recorded.fit import fit_whole

        return fit_whole(steps, asked, duty, instrument)
    for name, given in (("duty", duty), ("instrument", instrument or None)):
        if given is not None:
            raise UsageError(
                f"«{name}»: belongs to logs that are fitted as recorded, and these are steps; leave it out"
            )
    with progress("bootstrap refits", asked.draws if asked.ci == "bootstrap" else 0) as advance:
        return fit_steps(steps, asked, advance)


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
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> made = eaid.plan(fit, want={"Ts": 10.0}, check=False)
    >>> len(made.runs) == len(made.to_frame())
    True
    """
    from eaid.planning.recordings import PlanOptions, plan_recordings

    with progress("simulated recordings", 0) as advance:
        return plan_recordings(fit, chosen(PlanOptions, options, keywords), advance)


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
        return shortest_recording(fit, chosen(ExcitationOptions, options, keywords), advance)
