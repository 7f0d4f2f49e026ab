"""Gains by search: P's scale, ε and φ (ω_n and B̂ too, if asked) of least RMS torque error and limited chattering.

A candidate is replayed on plants drawn from the fit's uncertainty, with the torque noise that the logs show:

    cost          √(mean over plants and counted samples of e²)                       [N·m]
    chattering    mean over plants and counted samples of |u_k − u_{k−1}|             [% duty]

`Search.judge` puts another cost in the place of the first, as the stiffness of a wall (`eaid.coupling.entry`).

One that chatters more than the limit has P's scale lowered until it does not; one that misses 6 dB or 45° around an
operating point, the duty latched, does not count. The search is in the logarithms of the parameters: a scatter of
points around the start (seeded), then Nelder and Mead's simplex from the best two. Every replay meets the same noise,
so that the cost is a function of the candidate.

P's scale and ε enter the law as p/ε and γε only: along a line on which both stay as they are nothing changes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from eaid.arrays import Array
from eaid.control.bounds import Bounds
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG
from eaid.control.operating import Points, keeps_margins
from eaid.control.options import DesignOptions
from eaid.control.rc import RCGains
from eaid.control.rc_design import Law, law_of
from eaid.control.robust import damping_gains, frequency_and_damping
from eaid.errors import GainsError, UsageError
from eaid.limits import LIMITS
from eaid.models.parameters import Linear, Nonlinear
from eaid.options import Rig
from eaid.replay.controllers import rc_controller
from eaid.replay.many import replay_many
from eaid.replay.plant import PlantParameters, plant_parameters
from eaid.replay.references import Reference
from eaid.results.gain_checks import Candidate

RANGES = {"p_scale": 30.0, "epsilon": 10.0, "phi_honest_pct": 10.0, "frequency": 5.0, "b-hat": 3.0}
"""Each parameter is scattered over the start's value times and through this factor."""
LOWERINGS = 6
"""Runs to find the P's scale at which a candidate chatters just as much as it may."""
NEARLY = 0.998
"""… to this share of the limit, so that rounding does not lift it above."""
EDGE = 0.15
"""Edge of the first simplex, in shares of each parameter's range."""
NEAR = 2e-4
"""Where the cost is flat the candidate near the start is taken: at the edge of a range it counts as this share more."""
LEAST_PHI = 1e-3
"""φ below a thousandth of the actuator's span is none; the search needs a logarithm."""


@dataclass(frozen=True)
class Search:
    """How `optimize` looks."""

    noise_nm: float
    """White noise on the measured torque [N·m]."""
    limit_pct: float | None = None
    """Most chattering allowed [% duty per sample]; None: that of the start."""
    also: tuple[str, ...] = ()
    """Of `ALSO`."""
    scatter: int = 48
    """Points of the first, scattered search."""
    evaluations: int = 160
    """Candidates replayed after the scatter."""
    seed: int = 0
    judge: Callable[[RCGains], float] | None = None
    """What is made least in place of the RMS error: a function of the gains, above 0."""

    @property
    def candidates(self) -> int:
        """How many are replayed in all, the start included."""
        return 1 + self.scatter + self.evaluations


@dataclass(frozen=True)
class Trial:
    """A candidate and what it did on the plants."""

    law: Law
    did: Candidate
    """As gains.json has it."""
    cost: float
    """What the search makes least."""


@dataclass(frozen=True)
class Found:
    """The end of a search."""

    start: Trial
    best: Trial
    limit_pct: float


def errors_of(gains: RCGains, plants: Sequence[PlantParameters], reference: Reference, search: Search) -> Array:
    """Mean square error, largest error, mean |Δu| and share saturated of each plant, shape (4, N)."""
    table, begin = np.zeros((4, len(plants))), reference.begin
    wanted = reference.torque_nm[begin:, None]

    def visit(first: int, torque: Array, duty: Array) -> None:
        error, counted = np.abs(wanted - torque[begin:]), duty[begin:]
        held = (counted <= gains.duty_min) | (counted >= gains.duty_max)
        rows = (error * error).mean(0), error.max(0), np.abs(np.diff(counted, axis=0)).mean(0), held.mean(0)
        table[:, first : first + torque.shape[1]] = rows

    rig = Rig(noise_nm=search.noise_nm)
    replay_many(plants, rc_controller(gains), reference.torque_nm, rig, reference.dt_s, visit, search.seed)
    return table


def optimize(
    model: Linear, bounds: Bounds, start: DesignOptions, plants: Sequence[Nonlinear], points: Points,
    reference: Reference, search: Search, tick: Callable[[], None] = lambda: None,
) -> Found:  # fmt: skip
    """Search from `start`; `tick` is called once a candidate, `search.candidates` times in all.

    Raises GainsError where nothing that was tried keeps limit and margins.
    """
    flat = [plant_parameters(plant) for plant in plants]
    first_law = law_of(model, bounds, start)
    natural, damping = frequency_and_damping(start.K_P, start.K_D)
    span = start.duty_limits_pct[1] - start.duty_limits_pct[0]
    origin = {
        "p_scale": start.p_scale,
        "epsilon": start.epsilon,
        "phi_honest_pct": max(first_law.phi_honest_pct, LEAST_PHI * span),
        "frequency": natural,
        "b-hat": first_law.gains.B_hat,
    }
    names = [name for name in origin if name in search.also or name not in ALSO]
    centre = np.log([origin[name] for name in names])
    width = np.log([RANGES[name] for name in names])
    # γε stays at 5 or more, where the printed switch has no jump to speak of.
    least_epsilon = min(5.0 / start.gamma, start.epsilon)

    def options_at(x: Array) -> DesignOptions:
        at = dict(zip(names, np.exp(centre + x * width).tolist(), strict=True))
        K_P, K_D = damping_gains(at["frequency"], damping) if "frequency" in at else (start.K_P, start.K_D)
        return replace(
            start, p_scale=at["p_scale"], epsilon=max(at["epsilon"], least_epsilon), K_P=K_P, K_D=K_D,
            phi_honest_pct=at["phi_honest_pct"], B_hat=at.get("b-hat", start.B_hat),
        )  # fmt: skip

    def trial_of(options: DesignOptions) -> Trial:
        law = law_of(model, bounds, options)
        square, largest, chatter, saturated = errors_of(law.gains, flat, reference, search)
        rms = math.sqrt(float(square.mean()))
        did = Candidate(
            p_scale=options.p_scale, epsilon=options.epsilon, phi_honest_pct=law.phi_honest_pct, B_hat=law.gains.B_hat,
            K_P=options.K_P, K_D=options.K_D, equal_pi=law.equal_pi, rms_error_nm=rms,
            worst_plant_rms_error_nm=math.sqrt(float(square.max())), max_abs_error_nm=float(largest.max()),
            mean_abs_duty_step_pct=float(chatter.mean()), saturated_fraction=float(saturated.mean()),
        )  # fmt: skip
        return Trial(law, did, rms if search.judge is None else search.judge(law.gains))

    def within_limit(options: DesignOptions) -> Trial:
        """The candidate itself, or with P's scale lowered until it chatters just as much as it may."""
        trial = trial_of(options)
        slope = 1.0  # of ln chattering over ln p; corrected by what the last two runs show
        for _ in range(LOWERINGS):
            if trial.did.mean_abs_duty_step_pct <= limit:
                break
            goal = math.log(NEARLY * limit / trial.did.mean_abs_duty_step_pct)
            scale = max(trial.law.options.p_scale * math.exp(goal / slope), LIMITS["p_scale"].least)
            if scale >= trial.law.options.p_scale:
                break
            lower = trial_of(replace(options, p_scale=scale))
            fell = math.log(lower.did.mean_abs_duty_step_pct / trial.did.mean_abs_duty_step_pct)
            slope = min(max(fell / math.log(scale / trial.law.options.p_scale), 0.2), 1.0)
            trial = lower
        return trial

    first = trial_of(start)
    tick()
    limit = first.did.mean_abs_duty_step_pct if search.limit_pct is None else search.limit_pct
    allowed: list[tuple[float, Trial]] = []
    if first.did.mean_abs_duty_step_pct <= limit and keeps_margins(first_law.gains, points, start.timing):
        allowed.append((first.cost, first))

    def cost(x: Array) -> float:
        """The cost; more than that of the start where the limit cannot be kept or a margin is missed."""
        tick()
        try:
            trial = within_limit(options_at(x))
        except (GainsError, UsageError):  # no ρ covers this B̂, or it lies beyond any rig
            return 100 * first.cost
        refused = trial.did.mean_abs_duty_step_pct > limit
        if trial.cost < first.cost or not allowed:
            refused = refused or not keeps_margins(trial.law.gains, points, start.timing)
        far = NEAR * float(x @ x) + float(np.maximum(np.abs(x) - 1.0, 0.0).sum())
        judged = trial.cost * (1 + far)
        if not refused and (trial.cost < first.cost or not allowed):
            allowed.append((judged, trial))
        return judged + (10 * first.cost if refused else 0.0)

    random = np.random.default_rng(search.seed)
    scattered = [np.zeros(len(names)), *random.uniform(-1, 1, (search.scatter - 1, len(names)))]
    costs = [cost(x) for x in scattered]
    for k in np.argsort(costs, kind="stable")[:2]:
        corners = scattered[k] + EDGE * np.vstack([np.zeros(len(names)), np.eye(len(names))])
        minimize(
            cost, scattered[k], method="Nelder-Mead",
            options={"maxfev": search.evaluations // 2, "initial_simplex": corners, "xatol": 0.0, "fatol": 0.0},
        )  # fmt: skip
    if not allowed:
        raise GainsError(
            f"nothing that was tried chatters less than {limit:.3g} % duty per sample and keeps {ENOUGH_DB:g} dB and "
            f"{ENOUGH_DEG:g}°; allow more with «chatter_limit»"
        )
    best = min(allowed, key=lambda judged: judged[0])[1]
    return Found(first, best, limit)
