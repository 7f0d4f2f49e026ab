"""Fit → gains, gains → replay, and how stiff a virtual wall they may render."""

import os
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eaid.api.given import Paths, chosen, paths_of
from eaid.progress import Progress, no_progress
from eaid.reading import InputOptions
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.results.tuning import TuneOptions
from eaid.steps.stepset import StepSet

if TYPE_CHECKING:
    from eaid.coupling.options import CoupleOptions
    from eaid.replay.options import SimulateOptions


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
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> gains.rc.K_P, gains.rc.K_D
    (4.5, 3.0)
    >>> gains.guarantee.holds, "duty-limit" in gains.guarantee.missing
    (False, True)
    """
    from eaid.replay.references import read_reference
    from eaid.replay.scenarios import SCENARIOS
    from eaid.replay.tune import tune

    asked = chosen(TuneOptions, options, keywords)
    named = "" if reference is None else str(reference)
    signal = (named or None) if reference is None or named in SCENARIOS else read_reference(Path(reference))
    return tune(fit, asked, logs, signal, named, progress)


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
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
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
    asked = options or chosen(SimulateOptions, None, {"scenario": scenario, "rig": rig, **rest})
    refuse_several(asked.scenario, reference, log)
    signal = None if reference is None else read_reference(Path(reference))
    if log is not None:
        asked.check_for("log")
    runs = None if log is None else read_runs(paths_of(log), (reading or InputOptions()).reading())
    return with_wall_findings(replayed(fit, gains, asked, signal, runs, progress), fit, gains)


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
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> gains = eaid.tune_rc(fit)
    >>> found = eaid.couple(fit, gains, torques=(1.0,), loops=("pi", "rc"), replay=False)
    >>> [wall.loop for wall in found.walls]
    ['pi', 'rc']
    """
    from eaid.coupling.entry import couple_fit
    from eaid.coupling.options import CoupleOptions

    return couple_fit(fit, gains, chosen(CoupleOptions, options, keywords), progress)
