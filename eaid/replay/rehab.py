"""Elbow rehabilitation on the clutch (§VII, specification 7): outer loops command the torque that is rendered.

    resistive   T_des = −K (θ − 10°) for θ ≥ 10°, else 0                      Eqs. (17); K = 1 (soft), 3 N·m/rad (hard)
    assisted    T_des = K_I ∫ (θ_des − θ) dt + K_P (θ_des − θ)                Eq. (18)
    limb        I θ'' = M_user + s T − d θ' − g sin θ                         defaults: specification 7
    user        M_user = k (θ_des − θ) + b (θ_des' − θ'), 0.12 s late, + g sin θ + a slow random moment; else passive

One mode fades into the next as (1 + tanh((t − t_switch)/0.5 s))/2, the user's effort with it. The rotor's direction s
gives the torque its sign: −1 (extension) until the middle of the blend into the assisted mode, then +1 (flexion). The
clutch makes 0…T_s(100 %) of it, and its reference changes by at most 20 N·m/s. What the clutch still holds when the
rotor turns round changes its sign at once: 0.2…0.3 N·m on the reference plant, its slow part mostly.
"""

import itertools
import math
from collections.abc import Callable, Mapping

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.errors import GainsError, UsageError
from eaid.options import RigExtras
from eaid.plant.dynamics import PlantNumbers, plant_terms
from eaid.replay.controllers import Controller
from eaid.replay.loop import Held, coloured, hold_step, loop_columns, rig_numbers, sensor_noise
from eaid.replay.metrics import tracking_errors
from eaid.replay.references import samples_of
from eaid.results.replay import Box, CycleTest, Exercise, Metrics, ModeMetrics, ModesTest, Record, SampleTest

MODES = ("soft", "hard", "assisted")  # In the order of Fig. 16
# Where an elbow ends, overstretched or fully bent; a limb beyond it is a loop that has diverged
RANGE_DEG = (-10.0, 150.0)
RESISTED_FROM_DEG = 10.0


def rehabilitate(
    plant: PlantNumbers, controller: Controller, exercise: Exercise, rig: RigExtras, dt_s: float, seed: int = 0
) -> Record:
    """The session of one controller on one plant: soft, hard, assisted; GainsError where the limb leaves an elbow's
    range. Reference and torque of the loop have no sign; those of the limb are positive in flexion."""
    if exercise.mode_s <= exercise.uncounted_s:
        raise UsageError(
            f"rehab: a mode of {exercise.mode_s:g} s leaves nothing after the first {exercise.uncounted_s:g} s"
        )
    n = samples_of(len(MODES) * exercise.mode_s, dt_s)
    if exercise.mode_s < 10 * dt_s:
        raise UsageError(f"rehab: a mode of {exercise.mode_s:g} s is too short for a control interval of {dt_s:g} s")
    reference, *filled, target, angle, desired, rendered = _run(plant, controller, exercise, rig, n, dt_s, seed)
    target, angle = np.degrees(target), np.degrees(angle)
    columns = loop_columns(rig, plant, dt_s, reference, filled) | {
        "target_deg": target, "angle_deg": angle, "position_error_deg": target - angle, "desired_nm": desired,
        "rendered_nm": rendered, "torque_error_nm": desired - rendered,
        "mode": np.minimum(np.arange(n) * dt_s // exercise.mode_s, len(MODES) - 1),
    }  # fmt: skip
    return Record(columns, statistics(columns, controller.limits_pct, exercise, dt_s))


def _signals(exercise: Exercise, rig: RigExtras, n: int, dt: float, seed: int) -> tuple[Array, ...]:
    """What is known of a session before it is played: the target [rad] and its rate [rad/s], the user's tremor, the
    sensor's noise, the shares of the way to hard and to assisted; (n,) each."""
    t = np.arange(n) * dt
    phase = 2 * math.pi * exercise.movement_hz * t
    swing = math.radians(exercise.amplitude_deg)
    # the sensor's noise has another seed
    user_random = np.random.default_rng(int(np.random.SeedSequence([seed, 7]).generate_state(1, np.uint64)[0]))
    middle = exercise.mode_s * np.arange(1, len(MODES))
    return (
        math.radians(exercise.centre_deg) - swing * np.cos(phase),
        swing * 2 * math.pi * exercise.movement_hz * np.sin(phase),
        # the user's moment is white noise that forgets itself in tremor_s: an AR(1) of the same variance at any rate
        exercise.tremor_nm * coloured(n, dt, exercise.tremor_s, user_random),
        sensor_noise(rig, n, seed),
        *(0.5 * (1 + np.tanh((t - at) / exercise.blend_s)) for at in middle),
    )


def _run(
    plant: PlantNumbers, controller: Controller, exercise: Exercise, rig: RigExtras, n: int, dt: float, seed: int
) -> Array:
    """The session, sample by sample: reference, torque, measured, duty, applied, target, angle, desired, rendered;
    (9, n)."""
    signals = _signals(exercise, rig, n, dt, seed)
    law: Callable[..., tuple[object, float]] = controller.step
    gains, state = controller.gains, controller.start(dt)
    soft, hard = exercise.soft_nm_rad, exercise.hard_nm_rad
    k_p, k_i = exercise.assist_proportional, exercise.assist_integral
    stiffness, damping, weight = exercise.user_stiffness, exercise.user_damping, exercise.gravity_nm
    free = math.radians(RESISTED_FROM_DEG)
    low, high = (math.radians(limit) for limit in RANGE_DEG)
    most_nm = plant_terms(plant, plant.u_high)[2]
    fastest = exercise.slope_nm_s * dt
    turn, late = exercise.mode_s * (len(MODES) - 1), round(exercise.user_delay_s / dt)
    keep, push, drift, lift = limb_steps(exercise.inertia_kgm2, exercise.damping_nms, dt)
    delay, period = rig_numbers(rig, dt)
    delay += round(plant.late_s / dt)
    held = Held(0.0, 0.0, 0.0, 0)
    samples: list[tuple[float, ...]] = []
    angle, speed = float(signals[0][0]), 0.0
    reference = wound = 0.0
    effort: list[float] = []
    duties: list[float] = []
    for k, row in enumerate(zip(*(column.tolist() for column in signals), strict=True)):
        target, target_rate, tremor, disturbance, harder, assisted = row
        error = target - angle
        # what the user does: their own reaction of `late` ago; bearing the arm's weight is posture, at once
        effort.append(stiffness * error + damping * (target_rate - speed))
        moment = weight * math.sin(angle)
        user = (1.0 - assisted) * ((effort[k - late] if k >= late else 0.0) + moment + tremor)
        # what the robot wants
        against = ((1.0 - harder) * soft + (harder - assisted) * hard) * max(0.0, angle - free)
        assist = k_i * wound + k_p * error
        desired = assisted * assist - against
        flexing = k * dt >= turn
        sign = 1.0 if flexing else -1.0
        if flexing and (0.0 <= assist <= most_nm or (assist - most_nm) * error < 0.0):
            wound += error * dt
        wanted = min(max(sign * desired, 0.0), most_nm)
        before = reference
        reference += min(max(wanted - reference, -fastest), fastest)
        # what the clutch gives
        true = held.x1 + plant.z * held.x2
        seen = true + disturbance
        state, duty = law(gains, state, reference, (reference - before) / dt, seen, dt)
        duties.append(duty)
        held, applied = hold_step(plant, period, dt, k, duties[k - delay] if k >= delay else 0.0, held)
        samples.append((reference, true, seen, duty, applied, target, angle, desired, sign * true))
        # what the limb does, its moment held over the sample
        moment = user + sign * true - moment
        angle += drift * speed + lift * moment
        speed = keep * speed + push * moment
        if not low < angle < high:
            mode = MODES[min(int(k * dt / exercise.mode_s), len(MODES) - 1)]
            raise GainsError(
                f"rehab with {controller.name}: the {mode} mode diverges, the forearm passes "
                f"{math.degrees(angle):.0f}° at {k * dt:.2f} s (limb damping {exercise.damping_nms:g} N·m·s/rad); "
                "nothing is plotted of it; give the limb more damping or other gains"
            )
    return np.array(samples).T.copy()


def limb_steps(inertia_kgm2: float, damping_nms: float, dt_s: float) -> tuple[float, float, float, float]:
    """Exact step of I θ'' + d θ' = M for a held M: θ' ← keep θ' + push M, θ ← θ + drift θ' + lift M."""
    x = damping_nms * dt_s / inertia_kgm2
    once = -math.expm1(-x) / x if x > 0 else 1.0
    # (x − 1 + e^(−x))/x², by its series where it cancels
    twice = (1.0 - once) / x if x > 1e-4 else 0.5 - x / 6.0
    return math.exp(-x), once * dt_s / inertia_kgm2, once * dt_s, twice * dt_s**2 / inertia_kgm2


def statistics(
    columns: Mapping[str, Array], limits_pct: tuple[float, float], exercise: Exercise, dt_s: float
) -> Metrics:
    """Errors of the torque loop over all counted samples; boxes and tests by mode, |position error| in °: the paper's
    Student's t on samples taken as independent, and a test on the means of movement cycles."""
    from scipy import stats  # slow to import, as in `by_cycles`

    cycle = round(1 / exercise.movement_hz / dt_s)
    parts, errors, means, modes = [], {}, {}, {}
    for k, mode in enumerate(MODES):
        begin, end = (round((k * exercise.mode_s + after) / dt_s) for after in (exercise.uncounted_s, exercise.mode_s))
        part, whole = np.arange(begin, end), (end - begin) // cycle
        parts.append(part)
        errors[mode] = error = np.abs(columns["position_error_deg"][part])
        means[mode] = error[: whole * cycle].reshape(whole, cycle).mean(axis=1)
        modes[mode] = ModeMetrics(
            Box(float(error.mean()), *np.percentile(error, [25, 50, 75]).tolist()), tuple(means[mode].tolist()),
            float(np.abs(columns["torque_error_nm"][part]).mean()), float(stats.normaltest(error).pvalue),
        )  # fmt: skip
    tests = []
    for one, other in itertools.combinations(MODES, 2):
        student = stats.ttest_ind(errors[one], errors[other])
        samples = SampleTest((errors[one].size, errors[other].size), float(student.statistic), float(student.pvalue))
        tests.append(ModesTest((one, other), samples, by_cycles(means[one], means[other])))
    return Metrics(
        **msgspec.structs.asdict(tracking_errors(columns, limits_pct, np.concatenate(parts))), modes=modes,
        tests=tuple(tests),
    )  # fmt: skip


def by_cycles(first: Array, second: Array) -> CycleTest:
    """The exact rank test on the means of movement cycles; None where none is whole."""
    from scipy import stats

    n, m = first.size, second.size
    if min(n, m) == 0:
        return CycleTest((n, m))
    rank = stats.mannwhitneyu(first, second, method="exact")
    return CycleTest((n, m), float(rank.pvalue), 2 / math.comb(n + m, n))
