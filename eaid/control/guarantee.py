"""Whether the Lyapunov guarantee holds: one verdict, False where one thing fails, None where one is not known.

V = ξᵀQξ falls outside its last level where the duty is free (`ultimate_bound_nm`). At a limit, say the highest u_M,
the anti-windup has q̃˙ = 0 where e ≥ 0 and q̃˙ = e where e < 0. With every plant able to follow the reference itself,

    η̂(T_d) + φ + B Ṫ_d ≤ u_M                         for B of B_m and B_M, all along the reference                  (a)
    a0/(b0 B_m) ≤ det Q/(Q12 Q22)                                                                                    (b)
    B̂ Ṫ_d + η̂(T_d) + max(κ, 0) e_z ≤ u_M,            κ = B̂ (K_D − K_P Q22/Q12) − a0/b0                              (c)

V falls there too, in each of four cases:

    e ≥ 0, z > 0:   V̇ = 2 z ė, and ė < 0 by (a), for T ≤ T_d takes no more duty to hold
    e ≥ 0, z ≤ 0:   the law asks for B̂ Ṫ_d + η̂(T_d) + κ e at most, which (c) keeps below the limit: no such case
    e < 0, z ≤ 0:   the limit adds b (wanted − u_M) ≥ 0 to ė, and so 2 z b (wanted − u_M) ≤ 0 to V̇
    e < 0, z > 0:   V̇ = −2 |e| (Q11 q̃ − Q12 |e|) + 2 z ė, and ė ≤ a0/(b0 B_m) |e| by (a): below 0 by (b), z ≤ Q12 q̃
                    and |e| ≤ Q12 q̃/Q22

The lowest limit is the mirror image. e_z is the largest e at z = 0 on the level of V where the loop starts, from rest,
or ends. Where (b) fails, (a) has to hold for every torque within the largest error of that level.
All this is of a loop in continuous time; that sampling and latching leave of it what matters is judged by the margins
of the extreme plants, Ṫ = b (u − η̂(T)) with b = 1/B_M and 1/B_m, and by their errors along the reference.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.control.kinds import rc_law
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG, Point, enough, falling, finite, least_margins
from eaid.findings import Finding, finding
from eaid.plant.dynamics import Plant
from eaid.plant.linear import LinearPlant
from eaid.plant.operating import lag
from eaid.results.gains import Condition, Guarantee, Robust, Timing
from eaid.results.models import LinearLevel

NEED_ROUNDING = 1e-9  # Share by which the needed may exceed the available
SHARP = 5.0  # γε below which the printed switch, Eq. (14), visibly jumps at z = 0


class FallsOfB(NamedTuple):
    """B of the plant while its output falls: of its levels the least and the most, and whether logs show such falls
    between levels, or only those to rest do."""

    least: float
    most: float
    shown: bool


class Grounds(NamedTuple):
    """What the verdict rests on: what is known of rig and reference."""

    model: LinearPlant
    limits: tuple[float, float]  # Of the actuator [% duty]
    timing: Timing
    units: tuple[str, str]  # Of input and output
    phi: float | None = None  # What the data show of |η − η̂| [% duty]
    top_nm: float | None = None  # Highest torque of which they show it
    torque_nm: Array | None = None  # The reference at intervals of the control rate; None: not known
    dead_time_s: float = 0.0
    # Largest error in the end [N·m] on the plants of B_m and B_M under the loop as it is sampled and latched
    left: Callable[[Robust], float] | None = None
    falls: FallsOfB | None = None  # Where they differ from rises


def steepest(torque_nm: Array, dt_s: float) -> float:
    """Largest slope of a reference [N·m/s] by central differences, which the law feeds forward; by those from sample to
    sample where central ones pass over more than a hundredth of it, as at a jump."""
    central = float(np.abs(np.gradient(torque_nm, dt_s)).max())
    forward = float(np.abs(np.diff(torque_nm)).max()) / dt_s
    return forward if forward > 1.01 * central else central


def duties_asked(rc: Robust, grounds: Grounds, torque_nm: Array) -> tuple[float, float]:
    """Least and most duty [%] that (a) and (c) ask of the actuator along a reference that starts from rest, for any
    plant that the gains allow for."""
    assert rc.B_m is not None and rc.B_M is not None and rc.phi_honest_pct is not None
    step_s, model = grounds.timing.step_s, grounds.model
    (Q11, Q12), (_, Q22) = rc.Q
    det, per_nm = Q11 * Q22 - Q12 * Q12, model.a0 / model.b0
    forward = np.diff(torque_nm) / step_s
    torque = np.concatenate([torque_nm, torque_nm[:-1], torque_nm[1:]])
    rate = np.concatenate([np.gradient(torque_nm, step_s), forward, forward])
    end = math.inf if rc.ultimate_bound_nm is None else rc.ultimate_bound_nm**2 * det / Q11
    level = max(end, Q22 * float(torque_nm[0]) ** 2)
    followed = per_nm * torque - model.c0 / model.b0
    beyond = rc.phi_honest_pct
    if per_nm / rc.B_m > det / (Q12 * Q22):
        beyond += per_nm * math.sqrt(level * Q11 / det)
    moved = rc.B_m * rate, rc.B_M * rate
    kappa = rc.B_hat * (rc.K_D - rc.K_P * Q22 / Q12) - per_nm
    apart = kappa * Q12 * math.sqrt(level / (det * Q22)) if kappa > 0 else 0.0
    fed = followed + rc.B_hat * rate
    least = min((followed + np.minimum(*moved)).min() - beyond, fed.min() - apart)
    return float(least), float(max((followed + np.maximum(*moved)).max() + beyond, fed.max() + apart))


def _sampled(rc: Robust, grounds: Grounds) -> Condition:
    """Least margin of the extreme plants, the one that falls short where one does."""
    assert rc.B_m is not None and rc.B_M is not None
    model, middle = grounds.model, sum(grounds.limits) / 2
    gain = model.b0 / model.a0
    torque = gain * middle + model.c0 / model.a0
    points = [Point(middle, torque, lag(gain, B * gain)) for B in (rc.B_m, rc.B_M)]
    least = least_margins(rc_law(model, rc, grounds.limits), points, grounds.timing)
    wide = bool(least.stable) and (least.gain_db is None or least.gain_db >= ENOUGH_DB)
    if wide and not enough(least):
        return Condition("sampling", False, ENOUGH_DEG, least.phase_deg, "°")
    return Condition("sampling", wide, ENOUGH_DB, least.gain_db if least.stable else None, "dB")


def falls_of_b(plant: Plant, rows: Sequence[LinearLevel], bounds: tuple[float, float]) -> FallsOfB | None:
    """B of the levels' linear models, or its `bounds`, while the output falls: times τ1 of falls over that of rises;
    None where they are alike, or nothing is known of falls."""
    shown = falling(plant)
    down = shown or falling(replace(plant, falls_as_release=True))
    if down is None:
        return None
    each = [(row.level, row.level / (row.a0 * row.gain)) for row in rows] or [(plant.u_range[1], B) for B in bounds]
    found = [B * float(down.time_constants(u)[0] / plant.time_constants(u)[0]) for u, B in each]
    return FallsOfB(min(found), max(found), shown is not None)


def _falls_within(rc: Robust, falls: FallsOfB) -> Condition:
    """Whether B of falls lies within B_m and B_M, by that end of it which lies farther beyond them; not known where no
    log shows falls between levels."""
    assert rc.B_m is not None and rc.B_M is not None
    below, above = rc.B_m / falls.least, falls.most / rc.B_M
    needed, available = (falls.most, rc.B_M) if above >= below else (falls.least, rc.B_m)
    within = max(below, above) <= 1 + NEED_ROUNDING
    return Condition("falls", within or (False if falls.shown else None), needed, available, "")


def guarantee_of(rc: Robust, grounds: Grounds) -> Guarantee:
    """Everything that the argument needs: the verdict is True only where every condition is known to hold."""
    unit, per_s = grounds.units[0], f"{grounds.units[1]}/s"
    needed_rho = None if rc.rho.needed is None else rc.rho.needed.constant
    reference = grounds.torque_nm
    slope = None if reference is None else steepest(reference, grounds.timing.step_s)
    reach = None if reference is None else float(reference.max()) + (rc.ultimate_bound_nm or 0.0)
    least, most = (None, None) if reference is None else duties_asked(rc, grounds, reference)
    low, high = grounds.limits
    span = NEED_ROUNDING * (high - low)
    conditions = [
        Condition("rho", rc.rho_covers, needed_rho, rc.rho.constant, per_s),
        Condition("phi", _suffices(grounds.phi, rc.phi_honest_pct), grounds.phi, rc.phi_honest_pct, unit),
        Condition("range", _suffices(reach, grounds.top_nm) or None, reach, grounds.top_nm, grounds.units[1]),
        Condition("Q_M", _suffices(slope, rc.Q_M), slope, rc.Q_M, per_s),
        Condition("duty-limit", None if most is None else most <= high + span, finite(most), high, unit),
        Condition("duty-floor", None if least is None else least >= low - span, finite(least), low, unit),
        _sampled(rc, grounds),
    ]
    if grounds.falls is not None:
        conditions.append(_falls_within(rc, grounds.falls))
    if grounds.dead_time_s > 0:
        conditions.append(Condition("dead-time", False, 0.0, grounds.dead_time_s, "s"))
    bound, all_hold = rc.ultimate_bound_nm, all(each.holds for each in conditions)
    if all_hold and bound is not None and grounds.left is not None and (left := grounds.left(rc)) > bound:
        conditions.append(Condition("sampled-error", False, left, bound, grounds.units[1]))
    verdicts = [each.holds for each in conditions]
    return Guarantee(False if False in verdicts else None if None in verdicts else True, tuple(conditions))


def _suffices(needed: float | None, available: float | None) -> bool | None:
    return None if needed is None or available is None else bool(needed <= available * (1 + NEED_ROUNDING))


def warnings_of(rc: Robust, verdict: Guarantee, unit: str, reference: str) -> list[Finding]:
    """What does not hold, each with its numbers."""
    findings, sharpness = [], rc.gamma * rc.epsilon
    rows = {one.name: one for one in verdict.conditions}

    if rows["Q_M"].holds is False:
        findings.append(finding("slope-above-q-max", "rc", slope=rows["Q_M"].needed, Q_M=rc.Q_M, reference=reference))
    if not rc.rho_covers:
        findings.append(finding("rho-not-covered", "rc", B_hat=rc.B_hat, reached=rc.alpha_reached, made=rc.alpha))
    if rows["phi"].holds is False:
        needed, allowed = rows["phi"].needed, rows["phi"].available
        findings.append(finding("phi-exceeded", "rc", allowed=allowed, needed=needed, unit=unit))
    if sharpness < SHARP:
        findings.append(finding("switch-jumps", "rc", sharpness=sharpness, least=SHARP, jump=1 - math.tanh(sharpness)))
    low, high = rows["duty-floor"], rows["duty-limit"]
    if False in (low.holds, high.holds):
        findings.append(
            finding("plants-beyond-actuator", "rc", least=low.needed, most=high.needed, low=low.available,
                    high=high.available, unit=unit, reference=reference)
        )  # fmt: skip
    return findings
