"""Gains for a fit, and what they do on its plant: the robust controller beside PIs of its own margins, and the cost of
what the guarantee lacks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.control.defaults import (
    Scales,
    beyond_rc,
    control_rate,
    counted_from_rest,
    design_options,
    input_limits,
    of_this_mounting,
    pi_of,
    quickest,
    quickest_pi,
    scales_of,
    timing_of,
    workable_rc,
)
from eaid.control.design import Design, phi_needed, robust_of, seen_top_nm
from eaid.control.gains import RangeOfB, model_of, plant_of, range_of_b
from eaid.control.guarantee import Grounds, falls_of_b, guarantee_of, warnings_of
from eaid.control.kinds import LAW_KINDS, Law, designs, rc_law
from eaid.control.margins import Point, finite, least_margins, less_in_falls, margins_of, points_of, supposed_falls
from eaid.control.pi import PAPER_PI, PIGains, Wanted, step_metrics
from eaid.errors import DataError
from eaid.estimate.draw import draw, drawable
from eaid.findings import Finding, finding, ranked
from eaid.options import RigExtras, TuneOptions
from eaid.plant.dynamics import Plant, plant_numbers
from eaid.plant.linear import LinearPlant
from eaid.replay.controllers import feedback
from eaid.replay.loop import replay
from eaid.replay.metrics import step, tracking_errors
from eaid.replay.references import Reference, Signal, from_its_start, reference_beyond, reference_of
from eaid.results.fit import Fit
from eaid.results.gains import PI, AskedPI, Compared, Gains, Guarantee, Replayed, Robust, Timing, Tracking

OPEN_PART = 1.01  # By which B may lie outside of its range, and nothing is said
LATER = 0.1  # Part of the dead time by which loops that are designed for a later one say so
SETTLINGS, MOST_STEP_SAMPLES = 5.0, 200_000  # Of a PI's step behind a dead time, that are watched; samples at most
LARGEST_INPUT = 1e9
PLANTS = 100  # Plants of the next session by which φ is judged


@dataclass(frozen=True)
class Task:
    """What gains are made for: a rig, as its fit has it, and a reference."""

    fit: Fit
    model: LinearPlant
    plant: Plant | None
    bounds: RangeOfB
    scales: Scales
    points: Sequence[Point]  # Where margins are looked at
    falls: Sequence[Point]  # Of falls between levels that no log shows, as quick as those to rest
    timing: Timing
    limits: tuple[float, float]
    wanted: Reference
    name: str  # Of the reference
    given: bool  # Whether the user named it
    phi: float | None  # What the data show of |η − η̂|

    @property
    def units(self) -> tuple[str, str]:
        """Of input and output."""
        return self.fit.data.input_unit, self.fit.data.output_unit

    @property
    def grounds(self) -> Grounds:
        """What the guarantee is judged by; a slope that nothing follows says nothing."""
        followed = self.wanted.torque_nm if self.given or self.plant is not None else None
        phi, top = self.phi, seen_top_nm(self.bounds, self.plant)
        if len(self.fit.data.levels) == 1:  # nothing tells the input of any other output
            phi = top = None
        ends = self.bounds.B_m, self.bounds.B_M
        falls = None if self.plant is None else falls_of_b(self.plant, self.bounds.rows, ends)
        return Grounds(
            self.model, self.limits, self.timing, self.units, phi, top, followed, self.fit.dead_time_s,
            self.left_by_sampling, falls,
        )  # fmt: skip

    def left_by_sampling(self, rc: Robust) -> float:
        """Largest error in the later half of the reference on the plants of B_m and B_M, as the loop is sampled."""
        gain, controller = self.model.b0 / self.model.a0, feedback(rc_law(self.model, rc, self.limits))
        wanted, rig, worst = self.wanted, RigExtras(pwm_hz=self.timing.pwm_hz or 0.0), 0.0
        for tau in (float(rc.B_m or 0.0) * gain, float(rc.B_M or 0.0) * gain):
            extreme = Plant((tau,), (tau,), (self.model.c0 / self.model.a0, gain), (0.0, self.limits[1]), C=1.0)
            columns = replay(plant_numbers(extreme), controller, wanted.torque_nm, rig, wanted.dt_s)
            late = slice((wanted.begin + len(wanted.torque_nm)) // 2, None)
            worst = max(worst, tracking_errors(columns, controller.limits_pct, late).max_abs_error_nm or 0.0)
        return worst

    def designed(self, options: TuneOptions) -> Design:
        """The numbers that nothing was said about, settled."""
        slope = self.wanted.steepest_nm_s if self.given or not self.scales.paper else None
        return design_options(self.fit, options, self.scales, slope, self.phi)

    def robust(self, settled: Design, pi: PIGains) -> tuple[Design, Robust]:
        """The robust controller of a design, with the layer that its loop can have."""
        tuned = workable_rc(self.model, settled, self.scales, self.bounds, [*self.points, *self.falls], pi)
        return tuned, robust_of(self.model, self.bounds, tuned)

    def wanted_of(self, rc: Robust | None) -> Wanted:
        """What the other controllers of the table are designed for."""
        return Wanted(
            self.model, rc, self.timing, self.limits,
            partial(quickest, self.model, [*self.points, *self.falls], self.timing, self.scales.pace),
        )  # fmt: skip

    def quickest_pi(self) -> tuple[AskedPI, bool]:
        """The quickest PI; and whether it is slower for falls that no log shows, which it leaves out where no PI has
        its margins there."""
        model, timing, pace = self.model, self.timing, self.scales.pace
        known = quickest_pi(model, self.points, timing, pace, self.units[0])
        both = quickest(model, [*self.points, *self.falls], timing, pace) if self.falls else known
        return both or known, both not in (None, known)

    def errors(self, law: Law) -> Tracking:
        """What a controller does on the plant; nothing where there is none."""
        if self.plant is None:
            return Tracking()
        controller = feedback(law)
        columns = replay(plant_numbers(self.plant), controller, self.wanted.torque_nm, RigExtras(), self.wanted.dt_s)
        return tracking_errors(columns, controller.limits_pct, slice(self.wanted.begin, None))

    def step_of(self, pi: PIGains) -> tuple[float, float]:
        """Overshoot [%] and 2 % settling time [s] of a PI on the linear model, behind the fit's dead time."""
        overshoot_pct, settling_s = step_metrics(self.model, pi.K_P, pi.K_I)
        dead_s, slow_s = self.fit.dead_time_s, 1 / self.model.a0
        if not dead_s:
            return overshoot_pct, settling_s
        watched_s = SETTLINGS * min(settling_s, SETTLINGS * slow_s) + SETTLINGS**2 * dead_s
        dt_s = max(self.timing.step_s, watched_s / MOST_STEP_SAMPLES)
        gain, far = self.model.b0 / self.model.a0, (0.0, LARGEST_INPUT)  # of both signs, without an end
        plant = Plant((slow_s,), (slow_s,), (0.0, gain), far, C=1.0, Ts_below=(0.0, -gain), dead_time_s=dead_s)
        free = pi._replace(duty_min=-np.inf, duty_max=np.inf)
        wanted = np.ones(int(watched_s / dt_s))
        with np.errstate(all="ignore"):  # of a loop that is unstable
            torque = replay(plant_numbers(plant), feedback(free), wanted, RigExtras(), dt_s)["torque_nm"]
        if not np.abs(torque).max() < LARGEST_INPUT:
            return overshoot_pct, np.inf
        found = step(torque, 0.0, 1.0, dt_s)
        return found.overshoot_pct or 0.0, np.inf if found.settling_s is None else found.settling_s

    def compared(self, law: Law, slopes: tuple[float | None, float | None]) -> Compared:
        """A controller with its gains, least margins and errors."""
        least = least_margins(law, self.points, self.timing)
        return Compared(
            **msgspec.structs.asdict(self.errors(law)), K_P=slopes[0], K_I=slopes[1],
            stable=least.stable, gain_db=least.gain_db, phase_deg=least.phase_deg,
        )  # fmt: skip


def task_of(fit: Fit, options: TuneOptions, reference: str | Signal | None, reference_name: str) -> Task:
    """What gains are to be made for; DataError or GainsError where the fit does not hold it."""
    model, plant, bounds = model_of(fit), plant_of(fit), range_of_b(fit)
    scales, timing, limits = scales_of(fit, plant), timing_of(fit, options), options.duty_limits or input_limits(fit)
    name = reference_name or (reference if isinstance(reference, str) else "multisine")
    points = points_of(fit, plant, model, bounds.rows, limits)
    return Task(
        fit, model, plant, bounds, scales, points, supposed_falls(fit, plant, points),
        timing, limits, from_its_start(reference_of(reference or "multisine", timing.step_s, scales)), name,
        reference is not None,
        phi_of(fit, model, bounds, plant),
    )  # fmt: skip


def phi_of(fit: Fit, model: LinearPlant, bounds: RangeOfB, plant: Plant | None) -> float | None:
    """What the data show of |η − η̂|; of a fit by several sessions what 19 of 20 plants of the next one show."""
    if not fit.of_sessions or not drawable(fit):
        return phi_needed(model, bounds, plant)
    each = [phi_needed(model, bounds, one) or 0.0 for one in draw(fit, PLANTS, 0).plants]
    return float(np.quantile(each, 0.95))


# Findings of steps that slip, and of a reference step that is not what the sessions foresee
UNKNOWN_TO_PLANT = {"output-decays-under-hold", "step-outside"}


def unknown_to_plant(fit: Fit) -> list[Finding]:
    """What a fit says of its steps that its plant does not show, for every use of it to repeat."""
    shown = {"output-decays-under-hold"} if fit.plant_ is not None and fit.plant_.kind == "overshoot" else set()
    return [one for one in fit.findings if one.code in UNKNOWN_TO_PLANT - shown]


def tune(fit: Fit, options: TuneOptions, reference: str | Signal | None, reference_name: str) -> Gains:
    """`eaid.tune_rc` on what has been read; without a reference the multisine, which Q_M need not cover. GainsError
    where fit or wishes are not physical, out of reach or unstable, DataError where the fit lacks what is asked for."""
    # margins and replays are of the plant
    why = fit.verdict.of("linear").sentence or fit.verdict.of("nonlinear").sentence
    if why and not options.anyway:
        raise DataError(f"the fit is NOT USABLE: {why}; «anyway» makes gains of it all the same, marked")
    task = task_of(fit, options, reference, reference_name)
    settled, slowed = task.designed(options), False
    if options.pi_gains is None and options.pi_overshoot is None:
        asked, slowed = task.quickest_pi()
        settled = replace(settled, pi=asked)
    pi = pi_of(task.model, settled)
    no_rc = beyond_rc(task.model, task.timing, options)
    tuned, rc = (settled, None) if no_rc else task.robust(settled, pi)
    held, refused = designs(task.wanted_of(rc))
    laws: dict[str, Law] = {} if rc is None else {"rc": rc_law(task.model, rc, task.limits)}
    laws |= {"pi": pi, **{name: LAW_KINDS[name].law(task.model, gains, task.limits) for name, gains in held.items()}}
    judged, findings = margins_of(laws, task.points, task.timing, task.units[0])
    refused |= {"rc": no_rc} if no_rc else {}
    findings += [finding("controller-refused", name, why=why) for name, why in refused.items()]
    replayed = replay_beside(task, rc, laws)
    verdict = None
    if rc is not None:
        verdict, rc, more = judged_rc(task, rc)
        findings += more
    findings += _notes(task, settled, tuned, rc, replayed)
    findings += counted_from_rest(fit, task.limits)
    findings += of_this_mounting(fit, "gains, guarantee and margins")
    if fit.latest_dead_time_s > (1 + LATER) * fit.dead_time_s > 0:
        latest_s = fit.latest_dead_time_s
        findings.append(finding("designed-for-latest", "model", dead_time_s=fit.dead_time_s, latest_s=latest_s))
    findings += unknown_to_plant(fit)
    if slowed:
        findings.append(finding("falls-taken-as-releases", "pi"))
    both = {name: law for name, law in laws.items() if name in ("rc", "pi")}
    findings += less_in_falls(both, task.falls, task.timing, judged.worst)
    if why:
        findings.insert(0, finding("fit-not-usable", "model", why=why))
    overshoot_pct, settling_s = task.step_of(pi)
    designed = PI(pi.K_P, pi.K_I, overshoot_pct, finite(settling_s), None if settled.pi == AskedPI() else settled.pi)
    return Gains(
        model=task.model, rc=rc, pi=designed, controllers=held,
        input_unit=task.units[0], output_unit=task.units[1], duty_limits_pct=task.limits, guarantee=verdict,
        margins=judged, replayed=None if task.plant is None else replayed, options=options,
        seed=options.seed, not_usable=why or None, findings=ranked(findings),
    )  # fmt: skip


def judged_rc(task: Task, rc: Robust) -> tuple[Guarantee, Robust, list[Finding]]:
    """The verdict on the guarantee, the robust controller that knows whether its φ holds, and what is to be said."""
    verdict = guarantee_of(rc, task.grounds)
    phi_holds = next(one.holds for one in verdict.conditions if one.name == "phi")
    told = warnings_of(rc, verdict, task.units[0], "reference" if task.given else task.name)
    told += range_left_open(task.fit, rc) if verdict.holds else []
    return verdict, msgspec.structs.replace(rc, phi_holds=phi_holds), told


def range_left_open(fit: Fit, rc: Robust) -> list[Finding]:
    """Said where the data leave plants open whose B lies outside of the range that a guarantee speaks of."""
    linear = fit.linear
    of_bounds = None if linear is None or linear.bounds is None else linear.bounds.ci95
    ends = [] if of_bounds is None else [one for one in (of_bounds.B_m, of_bounds.B_M) if one is not None]
    if not ends and linear is not None and linear.ci95 is not None and (b0 := linear.ci95.b0) is not None and b0[0] > 0:
        ends = [(1 / b0[1], 1 / b0[0])]
    low, high = min((one[0] for one in ends), default=np.inf), max((one[1] for one in ends), default=-np.inf)
    if rc.B_m is None or rc.B_M is None or (low >= rc.B_m / OPEN_PART and high <= rc.B_M * OPEN_PART):
        return []
    return [finding("range-left-open", "rc", B_m=rc.B_m, B_M=rc.B_M, low=low, high=high)]


def replay_beside(task: Task, rc: Robust | None, laws: dict[str, Law]) -> Replayed:
    """The robust controller beside the PI that was designed, the PI of its own margins, with and without its
    feedforward, and the paper's PI where the rig is the paper's; and what else the table has.

    RC's feedforward a0 T/b0 is of the output that is read, so its loop has the slope K_P − a0/b0 by the error."""
    limits, pi = task.limits, laws["pi"]
    slopes: dict[str, tuple[float | None, float | None]] = {
        name: (getattr(law, "K_P", None), getattr(law, "K_I", None)) for name, law in laws.items()
    }
    if rc is not None and (alike := rc.equal_pi) is not None and alike.K_P is not None and alike.K_I is not None:
        slopes["rc"] = alike.K_P, alike.K_I
        if (K_P := alike.K_P - task.model.a0 / task.model.b0) > 0:
            slopes["equal_pi"], laws = (K_P, alike.K_I), {**laws, "equal_pi": PIGains(K_P, alike.K_I, *limits)}
    if task.scales.paper and pi[:2] != PAPER_PI:
        slopes["paper_pi"], laws = PAPER_PI, {**laws, "paper_pi": PIGains(*PAPER_PI, *limits)}
    rows = {name: task.compared(law, slopes[name]) for name, law in laws.items()}
    if (fed := rows.pop("pi-feedforward", None)) is not None:
        rows["equal_pi_feedforward"] = fed
    named = {name: rows.pop(name) for name in Replayed.ROWS if name in rows}
    return Replayed(task.name, task.wanted.steepest_nm_s, task.wanted.counted_from_s, **named, others=rows)


def _notes(task: Task, settled: Design, tuned: Design, rc: Robust | None, replayed: Replayed) -> list[Finding]:
    """What else is to be known of gains that were made."""
    findings, model, unit = [], task.model, task.units
    kind = "lag" if task.plant is None else task.plant.kind
    if rc is not None and settled.options.b_hat is None and rc.B_hat != 1 / model.b0:
        findings.append(finding("b-hat-between-levels", "rc", pooled=1 / model.b0, B_hat=rc.B_hat, B_m=rc.B_m))
    if not task.scales.paper:
        findings.append(
            finding(
                "designed-for-rig", "model", input_unit=unit[0], output_unit=unit[1],
                kind=f", plant: {kind}" if kind not in ("parallel", "lag") else "",
                pace=task.scales.pace, highest=task.limits[1], overshoot_pct=settled.pi.overshoot_pct or 0.0,
                settling_s=settled.pi.settling_s or 0.0,
            )
        )  # fmt: skip
    elif rc is not None and tuned != settled:
        findings.append(
            finding("rc-slowed", "rc", epsilon=tuned.epsilon, K_P=tuned.K_P, K_D=tuned.K_D, loop=task.timing.words())
        )
    usual_hz, rate = (task.fit.data.apparatus or Apparatus()).sample_rate_hz, task.timing.rate_hz
    if rate == control_rate(task.fit) > usual_hz:
        lag_s = 1 / model.a0
        told = finding(
            "control-rate-raised", "model", rate_hz=rate, usual_hz=usual_hz, lag_s=lag_s, samples=rate * lag_s
        )
        findings.append(told)
    if task.plant is None:
        findings.append(finding("nothing-to-replay-on", "model"))
        return findings
    falls = [point.duty_pct for point in task.points if task.plant.slope(point.duty_pct) <= 0 < point.plant.gain]
    if task.plant.sloped and falls:
        findings.append(finding("fall-within-interval", "model", falls, unit=unit[0]))
    findings += reference_beyond(task.wanted, plant_numbers(task.plant), task.name, unit[1])
    if replayed.paper_pi is not None:
        overshoot_pct, settling_s = step_metrics(model, *PAPER_PI)
        findings.append(
            finding("paper-pi", "pi", overshoot_pct=overshoot_pct, settling_s=settling_s, unit=unit[1],
                    error=replayed.paper_pi.max_abs_error_nm)
        )  # fmt: skip
    return findings
