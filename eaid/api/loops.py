"""A fit → gains → replays, virtual walls and code for the rig."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eaid.api.given import File, GivenTables, Paths, logs_in, result_of
from eaid.declared import given_options, taking
from eaid.errors import UsageError
from eaid.options import SCENARIOS, TRACKED, CoupleOptions, ExportOptions, ReadOptions, SimulateOptions, TuneOptions
from eaid.progress import Progress, no_progress
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike

    from eaid.export.export import ExportFolder
    from eaid.replay.controllers import OwnLaw


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

    fit, how = result_of("fit", fit, Fit), given_options(TuneOptions, options, keywords)
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
    log: "Paths | GivenTables | None" = None,
    reading: ReadOptions | None = None,
    progress: "Progress" = no_progress,
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
        Logs whose recorded input is replayed and compared, as `read` takes them, and how they are read.
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
    from eaid.reading import read_whole
    from eaid.replay.controllers import own_controllers
    from eaid.replay.simulate import simulate as replayed

    if isinstance(gains, str) and gains in SCENARIOS:
        raise UsageError(f"gains: {gains} is a «scenario»; give it by that name, or behind the gains")
    fit, gains = result_of("fit", fit, Fit), None if gains is None else result_of("gains", gains, Gains)
    names, own = own_controllers(controller)
    given = {"scenario": scenario, "controller": names}
    how = given_options(SimulateOptions, options, {k: v for k, v in given.items() if v is not None} | keywords)
    if sum(given is not None for given in (how.scenario, reference, log)) > 1:
        raise UsageError("«scenario», «reference» and «log» exclude each other; give one of them")
    if reading is not None and log is None:
        raise UsageError("«reading»: says how a «log» is read; give both or neither")
    if log is not None:
        how.check_for("log")
    runs = None if log is None else read_whole(logs_in(log), reading or ReadOptions(), fit.options.reading)
    return replayed(fit, gains, how, reference, runs, progress, own)


@taking(CoupleOptions)
def couple(
    fit: "Fit | File",
    gains: "Gains | File | None" = None,
    options: CoupleOptions | None = None,
    *,
    progress: "Progress" = no_progress,
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

    fit, gains = result_of("fit", fit, Fit), None if gains is None else result_of("gains", gains, Gains)
    return walls(fit, gains, given_options(CoupleOptions, options, keywords), progress)


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
    (('pi', 'rc', 'pi-feedforward'), True)
    """
    from eaid.export.export import export as exported

    gains = None if gains is None else result_of("gains", gains, Gains)
    fit = None if fit is None else result_of("fit", fit, Fit)
    return exported(gains, fit, given_options(ExportOptions, options, keywords), Path(output_dir), force)
