"""The options of `eaid.options`: every limit and word refuses what is beyond it, by name, in Python and when typed."""

import dataclasses
import inspect
import math
from collections.abc import Callable

import pytest

import eaid
from eaid import options
from eaid.declared import Options, forms
from eaid.errors import on_command_line

TYPES = [kind for kind in vars(options).values() if inspect.isclass(kind) and issubclass(kind, Options)]
TYPES = [kind for kind in TYPES if dataclasses.is_dataclass(kind) and forms(kind)]
NUMBERS = [(kind, name, form) for kind in TYPES for name, form in forms(kind).items() if {int, float} & set(form.parts)]


@pytest.mark.parametrize(("kind", "name", "form"), NUMBERS, ids=[f"{k.__name__}.{n}" for k, n, _ in NUMBERS])
def test_a_number_beyond_its_limits_is_refused_by_name(kind, name, form) -> None:
    declared = form.declared
    assert math.isfinite(declared.least) and math.isfinite(declared.most), "an option without limits"
    below = declared.least if declared.above else declared.least - max(1.0, abs(declared.least))
    for value in (below, declared.most * 10 + 1, math.nan):
        with pytest.raises(eaid.UsageError, match=f"^{name}= .*: give a (whole )?number (from|above) "):
            kind(**{name: value})
    with pytest.raises(eaid.UsageError, match=f"{name}="):
        kind(**{name: [1.0]})


def test_a_sentence_names_an_option_by_its_own_flag() -> None:
    flags = {name: form.flag for kind in TYPES for name, form in forms(kind).items()}
    assert len(flags) > 80 and {name: on_command_line(f"«{name}»") for name in flags} == flags


def test_a_default_lies_within_its_limits() -> None:
    assert all(kind() is not None for kind in TYPES)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: eaid.FitOptions(loss="l1"), "loss= l1: must be one of squares, huber"),
        (lambda: eaid.FitOptions(share=2.0), "share= 2: give a number above 0, 0.999 at most, or free"),
        (lambda: eaid.FitOptions(model=("nonlinaer",)),
         "model= nonlinaer: must be one of friction, nonlinear, linear; did you mean nonlinear?"),
        (lambda: eaid.ReadOptions(repair="yes"), "repair= 'yes': give True or False"),
        (lambda: eaid.ReadOptions(name_pattern="run"), "name_pattern= run: holds neither {level} nor {repeat}"),
        (lambda: eaid.ReadOptions(apparatus="surfaces=0"), "apparatus= surfaces=0: Expected int >= 1: surfaces"),
        (lambda: eaid.TuneOptions(damping=0.7),
         "natural_frequency= and damping= belong together: give both or neither"),
        (lambda: eaid.TuneOptions(pi_gains=(21, 360), pi_overshoot=1.0, pi_settling=0.3),
         "give either pi_gains= or pi_overshoot= with pi_settling=, not both"),
        (lambda: eaid.TuneOptions(duty_limits=(50.0, 50.0)), "duty_limits= 50,50: must rise"),
        (lambda: eaid.SimulateOptions(limb_damping=0.1), "limb_damping=: belongs to scenario= rehab; leave it out"),
        (lambda: eaid.SynthOptions(shape={"duty": (1, 2)}), "shape=: does nothing without excitation=; leave it out"),
    ],
)  # fmt: skip
def test_what_means_nothing_gets_one_sentence(make: Callable[[], object], sentence: str) -> None:
    with pytest.raises(eaid.UsageError) as refused:
        make()
    assert str(refused.value) == sentence


def test_all_faults_are_told_at_once() -> None:
    with pytest.raises(eaid.UsageError) as refused:
        eaid.TuneOptions(kp=1e99, gamma=0.0, rho="book")
    assert len(refused.value.sentences) == 3


def test_one_number_is_a_list_of_one() -> None:
    assert eaid.FitOptions(hold_out=60.0) == eaid.FitOptions(hold_out=(60.0,)) == eaid.FitOptions(hold_out=60)


def test_options_and_keywords_that_disagree_are_refused(small_steps: eaid.StepSet) -> None:
    whole = eaid.FitOptions(share=0.9, ci="none", model="linear")
    assert eaid.fit(small_steps, whole, share=0.9).options.share == 0.9
    with pytest.raises(eaid.UsageError, match=r"^share= 0.8: the options given say 0.9; say it in one place$"):
        eaid.fit(small_steps, whole, share=0.8)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda fit: eaid.simulate(fit, options=LOUD, noise_nm=0.5), "noise_nm= 0.5: the options given say 0.1"),
        (lambda fit: eaid.simulate(fit, reading=eaid.ReadOptions()), "reading=: says how a log= is read"),
        (lambda fit: eaid.couple(fit, loops=("pi", "open-loop")), "the loop pi needs gains with a PI"),
        (lambda fit: eaid.export(None, "none", fit, law=("plant",), duty_on_fault=3.0), "duty_on_fault=: is of a"),
        (lambda _fit: eaid.synth(clean=True, coloured_s=0.3), "coloured_s=: does nothing without coloured="),
        (lambda _fit: eaid.synth(excitation="chirp", shape={"rest_s": 2.0}), "rest_s: does nothing"),
        (lambda _fit: eaid.synth(excitation="chirp", shape={"rate_hz": 9.0}, rate_hz=8.0), "another option says 8.0"),
        (lambda _fit: eaid.synth(excitation="random", shape={"kind": "chirp"}), "another option says random"),
    ],
)  # fmt: skip
def test_what_would_be_dropped_is_refused(
    small_fit: eaid.Fit, make: Callable[[eaid.Fit], object], sentence: str
) -> None:
    with pytest.raises(eaid.UsageError) as refused:
        make(small_fit)
    assert sentence in str(refused.value)


def test_keywords_of_a_rig_are_joined_with_the_options_and_none_is_dropped(small_fit: eaid.Fit) -> None:
    how = eaid.SimulateOptions(scenario="steps", duration=2.0, rate_hz=100.0)
    assert eaid.simulate(small_fit, options=how, noise_nm=0.5).head.rig.noise_nm == 0.5
    rig = eaid.simulate(small_fit, options=LOUD, duration=2.0, rate_hz=100.0, pwm_hz=50.0).head.rig
    assert (rig.noise_nm, rig.pwm_hz) == (0.1, 50.0)


LOUD: eaid.SimulateOptions = eaid.SimulateOptions(noise_nm=0.1)


def test_lists_words_and_numpy_numbers_are_taken(small_steps: eaid.StepSet) -> None:
    import numpy as np

    made = eaid.FitOptions(model="linear", hold_out=[40, 70], share=np.float64(0.9))
    assert (made.model, made.hold_out, made.share) == (("linear",), (40, 70), 0.9)
    assert eaid.FitOptions(bounds_levels=(30.0, 60.0)).bounds_levels == "30,60"
    assert dict(eaid.ReadOptions(columns='time=t,output="Load Cell"').columns) == {"time": "t", "output": "Load Cell"}
