"""Gains by search: P's scale, ε and φ of least RMS torque error and limited chattering.

A candidate is replayed on plants drawn from the fit's uncertainty, with the torque noise that the logs show:

    error         √(mean over plants and counted samples of e²)                       [N·m]
    chattering    mean over plants and counted samples of |u_k − u_{k−1}|             [% duty]

One that chatters more than the limit, or misses 6 dB or 45° around an operating point, the duty latched, does not
count. SciPy's differential evolution looks in the logarithms of the three, from a seed; every replay meets the same
noise, so that the error is a function of the candidate.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import Bounds as Box
from scipy.optimize import differential_evolution

from eaid.arrays import Array
from eaid.control.bounds import Bounds
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG
from eaid.control.operating import Points, keeps_margins
from eaid.control.options import DesignOptions
from eaid.control.rc import RCGains
from eaid.control.rc_design import law_of
from eaid.errors import GainsError, UsageError
from eaid.models.parameters import Linear
from eaid.replay.controllers import rc_controller
from eaid.replay.many import replay_many
from eaid.replay.plant import PlantParameters
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.results.gain_checks import Candidate

RANGES = {"p_scale": 30.0, "epsilon": 10.0, "phi_honest_pct": 10.0}
"""Each is looked for between the start's value over and times this factor."""
GENERATION = 15
"""Candidates in a generation."""


def errors_of(
    gains: RCGains, plants: Sequence[PlantParameters], reference: Reference, noise_nm: float, seed: int
) -> Array:
    """Mean square error, largest error, mean |Δu| and share saturated of each plant, shape (4, N)."""
    table, begin = np.zeros((4, len(plants))), reference.begin
    wanted = reference.torque_nm[begin:]

    def visit(index: int, torque: Array, duty: Array) -> None:
        error, counted = np.abs(wanted - torque[begin:]), duty[begin:]
        held = (counted <= gains.duty_min) | (counted >= gains.duty_max)
        table[:, index] = (error * error).mean(), error.max(), np.abs(np.diff(counted)).mean(), held.mean()

    rig = Rig(noise_nm=noise_nm)
    replay_many(plants, rc_controller(gains), reference.torque_nm, rig, reference.dt_s, visit, seed)
    return table


def optimize(
    model: Linear, bounds: Bounds, start: DesignOptions, plants: Sequence[PlantParameters], points: Points,
    reference: Reference, noise_nm: float, limit_pct: float | None, evaluations: int, seed: int,
    tick: Callable[[], None] = lambda: None,
) -> tuple[DesignOptions, Candidate, Candidate]:  # fmt: skip
    """Search from `start`: the options that it ends at, and what they and the start did; `tick` once a candidate.

    Without a limit [% duty per sample] the start's own chattering is the most. Raises GainsError where nothing that
    was tried keeps limit and margins.
    """
    origin = {
        "p_scale": start.p_scale,
        "epsilon": start.epsilon,
        # the logarithm of no φ at all is none
        "phi_honest_pct": max(law_of(model, bounds, start).phi_honest_pct, 1e-3 * np.ptp(start.duty_limits_pct)),
    }

    def options_at(x: Array) -> DesignOptions:
        at = {name: origin[name] * factor**power for (name, factor), power in zip(RANGES.items(), x, strict=True)}
        # γε stays at 5 or more, where the printed switch has no jump to speak of
        return replace(start, **{**at, "epsilon": max(at["epsilon"], min(5.0 / start.gamma, start.epsilon))})

    def done_by(options: DesignOptions) -> tuple[RCGains, Candidate]:
        law = law_of(model, bounds, options)
        square, largest, chatter, saturated = errors_of(law.gains, plants, reference, noise_nm, seed)
        return law.gains, Candidate(
            p_scale=options.p_scale, epsilon=options.epsilon, phi_honest_pct=law.phi_honest_pct, B_hat=law.gains.B_hat,
            K_P=options.K_P, K_D=options.K_D, equal_pi=law.equal_pi, rms_error_nm=math.sqrt(float(square.mean())),
            worst_plant_rms_error_nm=math.sqrt(float(square.max())), max_abs_error_nm=float(largest.max()),
            mean_abs_duty_step_pct=float(chatter.mean()), saturated_fraction=float(saturated.mean()),
        )  # fmt: skip

    _, before = done_by(start)
    limit = before.mean_abs_duty_step_pct if limit_pct is None else limit_pct
    refused = 10 * before.rms_error_nm

    def cost(x: Array) -> float:
        """The error; far more where the limit is not kept or a margin is missed."""
        tick()
        try:
            gains, did = done_by(options_at(x))
        except (GainsError, UsageError):  # no ρ covers this B̂, or it lies beyond any rig
            return 100 * refused
        if did.mean_abs_duty_step_pct > limit:
            return refused * (1 + did.mean_abs_duty_step_pct / limit)
        return did.rms_error_nm if keeps_margins(gains, points, start.timing) else refused

    found = differential_evolution(
        cost, Box([-1.0] * len(RANGES), [1.0] * len(RANGES)), x0=np.zeros(len(RANGES)), rng=seed, tol=0.0, polish=False,
        popsize=GENERATION // len(RANGES), maxiter=evaluations // GENERATION - 1,
    )  # fmt: skip
    if found.fun >= refused:
        raise GainsError(
            f"nothing that was tried chatters less than {limit:.3g} % duty per sample and keeps {ENOUGH_DB:g} dB and "
            f"{ENOUGH_DEG:g}°; allow more with «chatter_limit»"
        )
    best = options_at(found.x)
    return best, before, done_by(best)[1]
