"""Every sentence about steps: it renders from the values that its finding has."""

import pytest

from eaid.findings import finding, ranked, say
from eaid.findings.sentences.logs import STEP_ROWS

VALUES: dict[str, dict[str, object]] = {
    "other-shape-fits-better": {
        "shape": "one",
        "dead_time_s": 15.6,
        "rmse": 0.27,
        "plain_rmse": 0.72,
        "saved_pct": 63.0,
    },
    "several-edges": {
        "edges": 2,
        "at_s": (0.4, 1.4),
        "rise_s": (0.12, 0.16),
        "overshoot_pct": (1.0, 3.0),
        "settling_s": (0.14, -1.0),
    },
    "input-reverses": {"turns": 19, "upwards": 9},
    "input-sweeps": {"from_hz": 1.0, "to_hz": 12.0},
    "input-is-periodic": {"turns": 8, "hz": 0.5},
    "input-is-binary": {"switches": 31, "clock_s": 0.2},
    "input-moves": {},
    "counted-from-rest": {"rest": -5.0},
    "input-negative": {},
    "shape-misses": {"worst": 1.2, "share_pct": 25.0},
    "step-leaves-open": {"open": "tau2"},
    "cut-at-reversals": {"reversals": 19},
    "input-glitch": {"samples": 2},
    "short-pieces": {"pieces": 1, "fewest": 10},
    "step-from-output": {"step_s": 2.0},
    "step-at-first-sample": {"start": 20.63, "unit": "degC"},
    "no-rest-before-step": {"start": 20.63, "unit": "degC"},
    "spikes-before-step": {"samples": 1},
    "spikes": {"samples": 1, "value": 1000.0, "unit": "N·m", "at_s": 7.0},
    "slow-clock": {"sample_s": 1.0},
    "gap": {"gap_s": 3.0, "at_s": 5.0, "sample_s": 0.01},
    "input-ramps": {"ramp_s": 0.06, "moved_pct": 12.0},
    "input-ramps-on": {"ramp_s": 0.4, "moved_pct": 66.0},
    "step-in-gap": {"gap_s": 0.8, "at_s": 1.59, "moved_pct": 88.0},
    "jitter": {"low_s": 0.01, "high_s": 0.013},
    "idle-drifts": {"drift": 0.2, "unit": "N·m", "share_pct": 10.0},
    "not-at-rest": {"off": 1.17, "unit": "N·m", "share_pct": 58.0},
    "nearly-at-rest": {"off": 0.1, "unit": "N·m", "share_pct": 6.0},
    "unsettled-before-step": {"share_pct": 20.0},
    "saturated": {"samples": 300, "limit": 1.7, "unit": "N·m"},
    "saturated-behind-noise": {"limit": 1.3, "unit": "N·m"},
    "flat-topped": {"limit": 1.3, "unit": "N·m"},
    "same-ceiling": {"ceiling": 1.3, "unit": "N·m"},
    "sensor-stuck": {"for_s": 3.7, "at_s": 4.0, "value": 1.5, "unit": "N·m"},
    "sensor-stuck-briefly": {"for_s": 0.02, "at_s": 4.0, "value": 1.5, "unit": "N·m"},
    "coarse-output": {"resolution": 0.15, "unit": "N·m", "steps": 13.0},
    "decays-under-hold": {"lost_pct": 26.0},
    "window-too-short": {"window_s": 8.0, "tau2_s": None},
    "left-after-release": {"left_pct": 9.0, "after_s": 2.0},
    "level-contradicts-input": {"said": 5.0, "held": 50.0, "unit": "%"},
    "repeats-disagree": {"spread_pct": 23.0, "own_pct": -12.0, "unit": "%"},
    "repeats-differ-in-number": {"unit": "%", "few": 1, "most": 2},
    "duty-may-be-fraction": {},
    "level-to-level": {"steps": 3, "of": 5},
    "shape-explains-little": {"shape": "two", "R2": 0.31},
    "sign-differs": {"siblings": 3},
    "signs-turned": {"runs": 4},
}


def test_the_table_is_whole() -> None:
    assert VALUES.keys() == STEP_ROWS.keys()


@pytest.mark.parametrize("code", STEP_ROWS)
def test_it_renders(code: str) -> None:
    said = say(finding(code, "a", (40.0, 50.0), **VALUES[code]))  # type: ignore[arg-type]
    assert said and said != code
    assert "{" not in said and "--" not in said


def test_some_words() -> None:
    said = say(finding("several-edges", "a", **VALUES["several-edges"]))  # type: ignore[arg-type]
    assert "at 0.4 s (rise 0.12 s, overshoot 1 %, settled in 0.14 s)" in said
    assert "not settled" in said
    said = say(finding("other-shape-fits-better", "a", (50.0,), **VALUES["other-shape-fits-better"]))  # type: ignore[arg-type]
    assert said == "the step to 50 asks for one exponential behind a dead time of 15.6 s: RMSE 0.27 instead of 0.72"
    said = say(finding("window-too-short", "a", window_s=8.0, tau2_s=16.0))
    assert said.endswith("(about 16 s)")


def test_a_drifting_idle_is_told_before_what_only_follows_from_it() -> None:
    values = {"drift": 0.2, "unit": "N·m", "share_pct": 9.0}
    late = finding("window-too-short", "run", (60.0,), tau2_s=17.0, window_s=20.0)
    assert ranked([late, finding("idle-drifts", "run", (60.0,), **values)])[0].code == "idle-drifts"
