"""Every kind of plant, exported: C and Octave give the vectors back, and what replay and python-control give."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

import eaid
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond
from eaid.results.codec import to_plain
from eaid.results.plant import FittedPlant

from .conftest import COMPILERS, STRICT, compiled, fit_of, ran

DT = 0.01
LAG = Plant((0.3,), (0.3,), (0.0, 0.02), (5.0, 100.0), C=1.0)
CLUTCH = Plant((0.1, 2e-3), (2.0, 0.0, 1e-4), (0.02, 0.01, 1e-4), (10.0, 100.0))
KINDS = {
    "lag": replace(LAG, dead_time_s=0.07),
    "lag, both signs": replace(LAG, Ts_below=(0.0, -0.03), dead_time_s=0.037),
    "parallel": replace(CLUTCH, release=(0.05, 0.9)),
    "falls as the release": replace(CLUTCH, release=(0.05, 0.9), falls_as_release=True, dead_time_s=0.004),
    "falls": replace(CLUTCH, falls=(0.5, 1.7), release=(0.05, 0.9)),
    "through values": replace(
        CLUTCH, Ts_through=((10.0, 0.1), (40.0, 0.2), (55.0, 1.7), (100.0, 1.9)), release=(0.05, 0.9)
    ),
    "ringing through values": replace(LAG, zeta=0.2, Ts_through=((5.0, 0.1), (60.0, 1.7), (100.0, 1.9))),
    "overshoot": replace(CLUTCH, C=1.6, dead_time_s=0.125),
    "series": replace(LAG, zeta=1.4, C=1.0, dead_time_s=0.02),
    "ringing": replace(LAG, tau1=(0.05,), zeta=0.2, Ts_below=(0.0, -0.01)),
    "ringing, with a zero, late": replace(LAG, tau1=(0.05,), zeta=0.3, zero=0.7, dead_time_s=0.0312),
}


def fit_with(plant: Plant) -> eaid.Fit:
    return fit_of(release=None, nonlinear=None, plant=to_plain(FittedPlant.of(plant, ("%", "N·m"))))


DRIVE = """
#include <stdio.h>
#include "eaid_control.h"
int main(void)
{
    static eaid_plant_state s;
    double duty;
    (void)eaid_plant_init(&eaid_plant, &s, eaid_dt_s);
    while (scanf("%lf", &duty) == 1) printf("%.17g\\n", (double)eaid_plant_step(&eaid_plant, &s, (eaid_real)duty));
    return 0;
}
"""
RANDOM = np.random.default_rng(1)


def inputs_of(plant: Plant) -> np.ndarray:
    """At rest, then held for some samples each."""
    levels = RANDOM.uniform(-100.0 if plant.Ts_below else 0.0, 100.0, 40) * (RANDOM.uniform(size=40) > 0.2)
    return np.repeat(np.append(0.0, levels), 17)


@pytest.mark.parametrize("name", KINDS)
def test_the_c_answers_as_the_replay_does_and_gives_its_vectors_back_to_the_bit(tmp_path, name):
    plant, folder = KINDS[name], tmp_path / "c"
    eaid.export(None, folder, fit_with(plant), rate_hz=1 / DT, law=("plant",))
    done = ran(compiled(folder), cwd=folder)
    rows, exact = re.search(r"plant +(\d+) rows, +(\d+) to the bit, .* ok", done.stdout).groups()
    assert done.returncode == 0 and rows == exact
    (folder / "drive.c").write_text(DRIVE)
    assert ran(COMPILERS[0], *STRICT, "drive.c", "eaid_control.c", "-o", "drive", "-lm", cwd=folder).returncode == 0
    inputs = inputs_of(plant)
    said = ran("./drive", cwd=folder, input="\n".join(map(repr, inputs.tolist()))).stdout
    given, t = np.array([0.0, *map(float, said.split())]), np.arange(len(inputs) + 1) * DT
    assert np.abs(given - respond(plant, t[:-1], inputs, t)).max() < 1e-9 * np.abs(given).max()


@pytest.mark.skipif(not shutil.which("octave"), reason="no Octave")
def test_octave_repeats_the_vectors_of_every_kind(tmp_path):
    for name, plant in KINDS.items():
        eaid.export(None, tmp_path / "m", fit_with(plant), target="matlab", rate_hz=1 / DT, law=("plant",), force=True)
        done = ran("octave", "--no-gui", "-q", "--norc", "--eval", "exit(check())", cwd=tmp_path / "m")
        assert done.returncode == 0, f"{name}: {done.stdout} {done.stderr}"


def test_single_precision_holds_every_kind(tmp_path):
    for name, plant in KINDS.items():
        folder = tmp_path / name.replace(" ", "").replace(",", "")
        eaid.export(None, folder, fit_with(plant), precision="single", rate_hz=1 / DT, law=("plant",))
        assert ran(compiled(folder), cwd=folder).returncode == 0, name


@pytest.mark.parametrize(
    ("plant", "law", "sentence"),
    [
        (KINDS["ringing"], "inverse", "two states, ringing, which an exported inverse does not know"),
        (KINDS["lag, both signs"], "inverse", "an input of both signs, which an exported inverse does not know"),
        (replace(LAG, dead_time_s=164.0), "plant", r"takes 16400 samples at 100 Hz, 10000 at most; lower rate_hz="),
        (replace(LAG, tau1=(0.1, 1e-3), zeta=0.5), "plant", "a ringing whose time changes with the input"),
    ],
)
def test_what_no_export_can_do_is_refused_with_its_reason(tmp_path, plant, law, sentence):
    with pytest.raises(eaid.UsageError, match=sentence):
        eaid.export(None, tmp_path / "c", fit_with(plant), rate_hz=1 / DT, law=(law,))
