"""`eaid tune-rc`: tables, warnings, options that reach the gains, gains that are refused."""

import json
import re
from pathlib import Path

import pytest

from ..conftest import LINEAR, PLANT


@pytest.fixture
def tuned(by_hand, run_eaid):
    """The gains.json that these arguments make of a fit written by hand."""

    def tuned(words="", parts=None, **scales):
        by_hand(parts, **scales)
        ran = run_eaid(f"tune-rc fit.json -q --force {words}")
        assert (ran.code, ran.err) == (0, "")
        return json.loads(Path("gains.json").read_text(encoding="utf-8"))

    return tuned


def codes(gains):
    return {one["code"] for one in gains["findings"]}


def test_the_paper_s_linear_model_gives_the_paper_s_gains(by_hand, run_eaid):
    """Nothing but `linear` is needed of the fit."""
    by_hand({"nonlinear": None})
    ran = run_eaid("tune-rc fit.json -o g.json")
    gains = json.loads(Path("g.json").read_text(encoding="utf-8"))
    assert ran.code == 0 and gains["schema"] == "eaid/gains/1"
    assert gains["inputs"]["fit"]["path"] == "fit.json" and len(gains["inputs"]["fit"]["sha256"]) == 64
    rc, pi = gains["rc"], gains["pi"]
    contract = "K_P K_D B_hat B_m B_M alpha alpha_reached guaranteed rho_covers phi_holds Q_M phi rho epsilon gamma P Q"
    assert set(contract.split()) <= set(rc) and {"overshoot_pct", "settling_s"} <= set(pi)
    assert (rc["K_P"], rc["K_D"], rc["B_hat"], rc["B_m"], rc["B_M"]) == (4.5, 3.0, 12.5, 12.4, 42.6)
    assert (rc["epsilon"], rc["gamma"], rc["phi"], rc["Q_M"]) == (0.5, 50.0, 0.05, 5.0)
    assert rc["P"] == [[5.0, 0.0], [0.0, 5.0]] and rc["alpha"] == pytest.approx(0.549091, abs=1e-6)
    assert rc["rho"]["constant"] == pytest.approx(10.8125, abs=1e-4)
    assert (pi["K_P"], pi["K_I"]) == pytest.approx((156.6, 252.9), abs=0.1) and gains["duty_limits_pct"] == [0.0, 100.0]
    story = "guarantee NO: the robust term ρ covers 10.8 of the 19.3 N·m/s that the model's error needs\n"
    assert ran.out.startswith(story)
    assert len((ran.out + ran.err).splitlines()) <= 15 and re.search(r"^PI +K_P 157, K_I 253 ", ran.out, re.M)
    ran = run_eaid("tune-rc fit.json -o g.json --force --verbose")
    assert re.search(r"^ρ, constant +10\.81 ", ran.out, re.M) and re.search(r"^ρ, slope +6\.586 ", ran.out, re.M)
    assert "phase margin (°)" in ran.out and "published" in ran.out  # on the paper's rig
    assert ran.err.splitlines()[-1] == "g.json: gains of rc and pi; next: eaid simulate fit.json g.json"
    assert codes(gains) == {"rho-not-covered", "nothing-to-replay-on", "for-this-mounting"}
    assert gains["guarantee"]["holds"] is False
    assert {one["name"]: one["holds"] for one in gains["guarantee"]["conditions"]} == {
        "rho": False, "phi": None, "range": None, "Q_M": None, "duty-limit": None, "duty-floor": None, "sampling": True,
    }  # fmt: skip


def test_every_option_reaches_the_gains(tuned):
    words = "--kp 9 --kd 4 --epsilon 0.3 --gamma 60 --p-scale 3 --q-max 7 --phi 0.02 --b-hat minimax --pi-gains 30,100"
    gains = tuned(f"{words} --duty-limits 5,90 --pwm-hz 0 --rate-hz 500")
    rc, pi = gains["rc"], gains["pi"]
    assert (rc["K_P"], rc["K_D"], rc["epsilon"], rc["gamma"], rc["Q_M"], rc["phi"]) == (9, 4, 0.3, 60, 7, 0.02)
    assert rc["P"] == [[3.0, 0.0], [0.0, 3.0]] and rc["B_hat"] == pytest.approx(2 * 12.4 * 42.6 / 55, abs=1e-3)
    assert (pi["K_P"], pi["K_I"]) == (30.0, 100.0)
    assert gains["duty_limits_pct"] == [5.0, 90.0]
    assert gains["margins"]["timing"] == {"rate_hz": 500.0, "pwm_hz": None, "delay_samples": 0}


@pytest.mark.parametrize(
    ("linear", "sentence"),
    [
        ({"b0": -0.08}, "the fit's b0 is -0.08"),
        ({"a0": 0.0}, "the fit's a0 is 0 "),
        ({"bounds": {"B_m": 0.0, "B_M": 42.6}}, "the range of B touches 0"),
        ({"a0": 1e-59}, "a0 is 1e-59 1/s"),
        ({"b0": 0.0}, "b0 is 0; more input has to give more output"),
        ({"b0": 1e-300}, "b0 is 1e-300 and its c0 -2.42, which no rig has"),
        ({"c0": -1e20}, "c0 -1e+20, which no rig has"),
    ],
)
def test_a_linear_model_of_no_rig_is_refused(linear, sentence, by_hand, run_eaid):
    by_hand({"linear": {**LINEAR, **linear}})
    for line in ("tune-rc fit.json -o x", "simulate fit.json --controller open-loop")[: 1 if "bounds" in linear else 2]:
        ran = run_eaid(line)
        assert ran.code == 5 and sentence in ran.err and ran.err.count("error: ") == ran.err.count("\n") == 1


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"tau1": [0.5, -0.01, 0.0]}, "nonlinear.tau1 is 0.0004 s at an input of 49.96, which"),
        # below 0 only between two of the 101 duties that a fit's constraints hold at
        ({"tau1": [0.1 * 10.45**2 - 1e-6, -2.09, 0.1]}, "nonlinear.tau1 is -1e-06 s at an input of 10.45, which"),
        ({"tau2": [0.05, 0.0, 0.0]}, "nonlinear.tau2 is 0.05 s at an input of 10, below tau1, which"),
        ({"Ts": [-0.5, 0.02, 0.0, 0.0]}, "nonlinear.Ts is -0.3 at an input of 10, which"),
        ({"Ts": [1e-300, 1e-300, 0.0, 0.0]}, "nonlinear.Ts is 1.1e-299 at an input of 10, which"),
        ({"C": 1.5}, "nonlinear.C is"),
        ({"u_range": [100.0, 10.0]}, "nonlinear.u_range is"),
    ],
)
def test_a_plant_that_cannot_be_is_refused_by_all_that_use_it(changes, sentence, by_hand, run_eaid):
    by_hand({"nonlinear": {**PLANT, **changes}})
    for words in ("tune-rc fit.json", "simulate fit.json --controller inverse", "couple fit.json", "export fit.json"):
        ran = run_eaid(f"{words} -o x")
        assert ran.code == 3 and sentence in ran.err and ran.err.count("error: ") == ran.err.count("\n") == 1


def test_a_fit_without_what_is_needed(by_hand, run_eaid):
    by_hand({"linear": None, "nonlinear": None, "friction": {}})
    ran = run_eaid("tune-rc fit.json -o x")
    assert ran.code == 3 and "holds no linear model" in ran.err
    by_hand({"linear": {**LINEAR, "bounds": None}})
    ran = run_eaid("tune-rc fit.json -o x")
    assert ran.code == 2 and "the fit holds no range of B" in ran.err


def test_a_fit_that_is_not_usable_is_used_on_request_only(tuned, by_hand, run_eaid):
    stop = {"code": "one level only", "severity": "stop", "subject": "linear"}
    parts = {"linear": LINEAR, "nonlinear": None, "findings": [stop]}
    by_hand(parts)
    ran = run_eaid("tune-rc fit.json -o x")
    assert ran.code == 3
    assert "the fit is NOT USABLE: one level only; --anyway makes gains of it all the same, marked" in ran.err
    gains = tuned("--anyway", parts=parts)
    assert gains["not_usable"] == "one level only" and "fit-not-usable" in codes(gains)


def test_gains_of_another_fit_are_told_wherever_they_are_used(by_hand, run_eaid):
    by_hand()
    assert run_eaid("tune-rc fit.json -q --force -o gains.json").code == 0
    lines = ("simulate fit.json gains.json -o r.h5", "export gains.json fit.json --as yaml -o rig",
             "report fit.json gains.json --figures fig02 -o page")  # fmt: skip
    for seed, other in ((0, False), (7, True)):
        by_hand({"seed": seed} if other else None)
        for line in lines:
            assert ("the gains were made from another fit (fit.json)" in run_eaid(f"{line} --force").err) is other
