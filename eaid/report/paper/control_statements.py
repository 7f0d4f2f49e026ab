"""The text and the figures on control and rehabilitation, §V to §VII."""

import itertools
from typing import Any

import numpy as np

from eaid.report.paper.claim import FAILS, HERE, HOLDS, NO_RIG, ON_PLANT, SIMULATE, TUNE, UNDECIDED, Claim
from eaid.report.paper.evidence import TUNED_PI, Evidence
from eaid.report.tables import number


def control(found: Evidence) -> list[Claim]:
    """§V-B, §VI and Figs. 11–13."""
    rc, pi, tuned = (found.multisine[name] for name in ("rc", "pi", "pi-tuned"))
    less = 100 * (1 - rc["max_abs_error_nm"] / pi["max_abs_error_nm"])
    less_tuned = 100 * (1 - rc["max_abs_error_nm"] / tuned["max_abs_error_nm"])
    rise = {name: _mean(found.steps[name], "rise_time_s") for name in ("rc", "pi", "pi-tuned")}
    over = {
        name: max(step["overshoot_pct"] for step in found.steps[name]["steps"]) for name in ("rc", "pi", "pi-tuned")
    }
    last = found.steps["rc"]["steps"][-1]
    highest = max(step["to_nm"] for step in found.steps["rc"]["steps"])
    gain = {name: {row["frequency_hz"]: row for row in found.sweep[name]["frequencies"]} for name in found.sweep}
    to_1hz = max(abs(row["gain_db"]) for f, row in gain["rc"].items() if f <= 1.0)
    peak = max(gain["pi"].values(), key=lambda row: row["gain_db"])
    band = {name: _bandwidth(rows) for name, rows in gain.items()}
    errors = [np.mean([row["mean_abs_error_nm"] for row in gain[name].values()]) for name in ("rc", "pi")]
    low, high = (gain["pi"][f]["phase_deg"] for f in (0.2, 3.0))
    return [
        Claim(
            "§V-B",
            "PI of 21 and 360: 1 % overshoot, 0.27 s",
            f"{number(found.pi_printed.overshoot_pct, 3)} % and {number(found.pi_printed.settling_s, 3)} s "
            "on the published linear model (2 % band)",
            f"{TUNE} --pi-gains 21,360",
            FAILS,
            f"1 % and 0.27 s take K_P = {TUNED_PI[0]}, K_I = {TUNED_PI[1]}: {found.pi_tuned.overshoot_pct:.2f} % "
            f"and {found.pi_tuned.settling_s:.3f} s",
        ),
        Claim(
            "Fig. 11",
            "RC rises faster than the PI, with negligible overshoot",
            f"mean rise {number(rise['rc'], 2)} s against {number(rise['pi'], 2)} s; largest overshoot "
            f"{number(over['rc'], 2)} % against {number(over['pi'], 3)} %",
            f"{SIMULATE} steps",
            ON_PLANT,
            "first seven steps; the last falls by itself",
        ),
        Claim(
            "Fig. 11",
            "steps up and down between 0 and 4 N·m",
            f"{len(found.steps['rc']['steps'])} steps, {highest:g} N·m at most; the heights between are not printed",
            f"{SIMULATE} steps",
            NO_RIG,
            "a setting of the experiment; ours has the same ends",
        ),
        Claim(
            "Fig. 11",
            "torque variation after each step is removed by the RC",
            "–",
            f"{SIMULATE} steps --ripple-pct 1",
            NO_RIG,
            "the variation is friction's own; the replay can add a ripple, not the rig's",
        ),
        Claim(
            "Fig. 11",
            "the last fall is slow, as the duty cannot go below 0",
            f"{number(last['rise_time_s'], 2)} s from 90 to 10 %, not within 2 % after 5 s, for RC and PI alike",
            f"{SIMULATE} steps",
            ON_PLANT,
            "the release's time constants are an assumption unless logs hold it",
        ),
        Claim(
            "Fig. 12(b)",
            "RC error limited to 0.2 N·m",
            f"{number(rc['max_abs_error_nm'], 3)} N·m",
            f"{SIMULATE} multisine",
            ON_PLANT,
            "the paper's sum of sines is not printed; ours is 2 N·m and five sines of 0.2 N·m, 0.2 to 4 Hz, "
            "noise-free, after 5 s",
        ),
        Claim(
            "Fig. 12(b)",
            "PI error 1.2 N·m",
            f"{number(pi['max_abs_error_nm'], 3)} N·m",
            f"{SIMULATE} multisine",
            ON_PLANT,
            "in kind: several times the RC's",
        ),
        Claim(
            "Fig. 12(b)",
            "RC error 83 % less than the PI's",
            f"{less:.0f} % less than the PI of 21 and 360",
            f"{SIMULATE} multisine",
            ON_PLANT,
            "but that PI does not meet its own specification: see the next row",
        ),
        Claim(
            "Fig. 12(b)",
            "RC error 83 % less than a PI of 1 % and 0.27 s",
            f"{less_tuned:.0f} % less (PI error {number(tuned['max_abs_error_nm'], 3)} N·m)",
            f"{TUNE} --pi-overshoot 1 --pi-settling 0.27",
            FAILS,
            "with the PI that the text describes the advantage is smaller",
        ),
        Claim(
            "§VI",
            "a PI with a faster settling time would overshoot even more",
            f"largest overshoot {number(over['pi-tuned'], 2)} % with 156.6 and 252.9, "
            f"{number(over['pi'], 3)} % with 21 and 360",
            HERE,
            FAILS,
            "on the reference plant the faster PI overshoots less",
        ),
        Claim(
            "Fig. 12(a)",
            "the PI lags in phase",
            f"{number(low, 2)}° at 0.2 Hz, {number(high, 3)}° at 3 Hz",
            f"{SIMULATE} sweep",
            ON_PLANT,
        ),
        Claim(
            "Fig. 12(c)",
            "duty of both controllers",
            f"RC at a limit {100 * rc['saturated_fraction']:.0f} % of the time, PI "
            f"{100 * pi['saturated_fraction']:.0f} %",
            f"{SIMULATE} multisine",
            NO_RIG,
            "shown as a curve only",
        ),
        Claim(
            "Fig. 13(a)",
            "negligible loss of amplitude up to 1 Hz with the RC",
            f"within {number(to_1hz, 1)} dB",
            f"{SIMULATE} sweep",
            ON_PLANT,
        ),
        Claim(
            "Fig. 13(a)",
            "the PI overshoots close to 0.6 Hz",
            f"{peak['gain_db']:+.1f} dB at {number(peak['frequency_hz'], 1)} Hz",
            f"{SIMULATE} sweep",
            ON_PLANT,
        ),
        Claim(
            "Fig. 13(a)",
            "RC and PI improve the frequency response",
            f"−3 dB at {_hz(band['rc'])} (RC), {_hz(band['pi'])} (PI), {_hz(band['open-loop'])} (open loop)",
            f"{SIMULATE} sweep",
            ON_PLANT,
        ),
        Claim(
            "Fig. 13(b)",
            "the RC's tracking error is much less than the PI's",
            f"mean over 0.2…3 Hz {number(float(errors[0]), 2)} against {number(float(errors[1]), 2)} N·m",
            f"{SIMULATE} sweep",
            ON_PLANT,
        ),
    ]


def _mean(numbers: Any, key: str) -> float:
    """Mean of a number over the steps but the last, which no controller can speed up."""
    return float(np.mean([step[key] for step in numbers["steps"][:-1] if step[key] is not None]))


def _bandwidth(rows: dict[float, Any]) -> float | None:
    """First crossing of −3 dB [Hz], by straight lines between tones; 0 where it begins below, None where never."""
    points = sorted((f, row["gain_db"]) for f, row in rows.items())
    if points[0][1] < -3:
        return 0.0
    for (f0, g0), (f1, g1) in itertools.pairwise(points):
        if g1 < -3 <= g0:
            return float(f0 + (f1 - f0) * (g0 + 3) / (g0 - g1))
    return None


def _hz(f_hz: float | None) -> str:
    return "above 3 Hz" if f_hz is None else "below 0.2 Hz" if f_hz == 0 else f"{number(f_hz, 2)} Hz"


def rehabilitation(found: Evidence) -> list[Claim]:
    """§VII and Figs. 16, 17, on a simulated limb, RC with the published gains, seed 0."""
    modes = found.rehab["modes"]
    median = {name: modes[name]["abs_position_error_deg"]["median"] for name in modes}
    torque = {name: modes[name]["mean_abs_torque_error_nm"] for name in modes}
    tests = {tuple(test["modes"]): test for test in found.rehab["tests"]}
    longer = {tuple(test["modes"]): test for test in found.longer["tests"]}
    command = f"{SIMULATE} rehab"

    def p_of(pair: tuple[str, str]) -> str:
        test = tests[pair]
        sampled = test["samples"]["p"]
        by_samples = "< 1e−300" if sampled == 0 else number(sampled, 1)
        welch, rank = (number(test["cycles"][key], 1) for key in ("p_welch", "p_rank"))
        more = longer[pair]["cycles"]
        few = test["cycles"]["n"][0]
        said = f"p {by_samples} by samples; {welch} (Welch) and {rank} (ranks) by {few} movements a mode"
        return f"{said}, {number(more['p_welch'], 1)} and {number(more['p_rank'], 1)} by {more['n'][0]}"

    def differ(pair: tuple[str, str], printed: float) -> tuple[str, str]:
        """Verdict and reason: by movements, which are independent observations, as many as it takes."""
        few, more = (one[pair]["cycles"]["p_rank"] for one in (tests, longer))
        if more <= printed:
            least = number(tests[pair]["cycles"]["least_p_rank"], 1)
            reason = f"three movements a mode can give no rank p below {least}, more movements decide it"
            return ON_PLANT, f"samples 1 ms apart are no independent observations; {reason}"
        return UNDECIDED, f"rank p {number(few, 1)} and {number(more, 1)}: more movements would have to decide it"

    return [
        Claim("Eq. (17)", "K = 1 and 3 N·m/rad from 10° on", "used as printed", command, HOLDS),
        Claim("Eq. (18)", "K_I = 10, K_P = 3", "used as printed, the integral kept from winding up", command, HOLDS),
        Claim(
            "Fig. 16(b)",
            "position error grows with the stiffness",
            f"median {number(median['soft'], 2)}° soft, {number(median['hard'], 2)}° hard",
            command,
            ON_PLANT,
            "with a limb of our own: none was published",
        ),
        Claim(
            "Fig. 16(c)",
            "rendered torque perfectly follows the desired one",
            f"mean error {number(torque['soft'], 2)}, {number(torque['hard'], 2)}, "
            f"{number(torque['assisted'], 2)} N·m (soft, hard, assisted)",
            command,
            ON_PLANT,
        ),
        Claim(
            "Fig. 16(d)",
            "no remarkable difference in torque error between soft and hard",
            f"{number(torque['soft'], 2)} and {number(torque['hard'], 2)} N·m",
            command,
            ON_PLANT,
        ),
        Claim(
            "Fig. 16(b)",
            "position error is less when assisted than when resisted",
            f"median {number(median['assisted'], 2)}° assisted",
            command,
            ON_PLANT,
            "against the soft mode the order depends on the seed",
        ),
        Claim(
            "Fig. 17",
            "normality validated, p < 0.001",
            "p < 0.001 in all three modes",
            command,
            FAILS,
            "a small p rejects normality; so a rank test stands beside the t-tests",
        ),
        Claim(
            "Fig. 17",
            "soft and hard differ, p = 0.001",
            p_of(("soft", "hard")),
            command,
            *differ(("soft", "hard"), 0.001),
        ),
        Claim(
            "Fig. 17",
            "soft and assisted differ, p < 0.005",
            p_of(("soft", "assisted")),
            command,
            *differ(("soft", "assisted"), 0.005),
        ),
        Claim(
            "Fig. 17",
            "hard and assisted differ, p < 0.005",
            p_of(("hard", "assisted")),
            command,
            *differ(("hard", "assisted"), 0.005),
        ),
    ]
