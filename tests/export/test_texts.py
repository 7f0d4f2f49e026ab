"""The other languages: Octave, YAML, plain Python; and how numbers are written."""

import math
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import yaml

from eaid.export.constants import commented, decimal, hexadecimal

from .conftest import LAWS, constants

NUMBERS = (0.0, -0.0, 1.0, -0.1, 1e-12, 1e300, 5e-324, 100.0, 1 / 3, math.pi)


@pytest.mark.parametrize("number", NUMBERS)
def test_numbers_come_back_to_the_bit(number):
    assert float.fromhex(hexadecimal(number)) == number
    assert float(decimal(number)) == number and "." in decimal(number)
    single = np.float32(number) if abs(number) < 1e30 else np.float32(3.4)
    assert hexadecimal(single).endswith("F") and np.float32(float.fromhex(hexadecimal(single)[:-1])) == single
    assert np.float32(decimal(single)) == single


def test_a_head_cannot_end_its_comment():
    text = commented(["evil */ int main() {", "two\nlines"], " * ")
    assert "*/" not in text and len(text.splitlines()) == 2


@pytest.mark.skipif(not shutil.which("octave"), reason="no Octave")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_octave_repeats_the_vectors(exported, precision):
    command = ["octave", "--no-gui", "-q", "--norc", "--eval", "printf('failed %d\\n', check());"]
    done = subprocess.run(command, cwd=exported("matlab", precision), capture_output=True, text=True, check=False)
    assert "failed 0" in done.stdout, done.stderr
    assert re.search(r"largest difference (\S+),", done.stdout)[1] == "0"  # the bits


@pytest.mark.skipif(not shutil.which("octave"), reason="no Octave")
def test_octave_refuses_another_sample_time_and_runs_the_block(exported):
    code = (
        "s = eaid_rc_init(0.002); [u, s] = eaid_rc_step(s, 1, 0, 0); printf('%g %d\\n', u, s.status);"
        "[u, status] = eaid_rc_block(1, 0, 0); printf('%.17g %d\\n', u, status); m = [];"
        "[r, m] = eaid_rate_step(m, 1); [r, m] = eaid_rate_step(m, 2); printf('%.17g\\n', r);"
    )
    command = ["octave", "--no-gui", "-q", "--norc", "--eval", code]
    done = subprocess.run(command, cwd=exported("matlab"), capture_output=True, text=True, check=False)
    refused, block, rate = done.stdout.splitlines()
    assert refused == "0 33" and block.split()[1] in ("0", "8")
    assert float(rate) == pytest.approx(145.4, rel=1e-3)


def test_the_yaml_holds_every_constant(exported):
    told = yaml.safe_load((exported("yaml") / "parameters.yaml").read_text())["eaid_controller"]["ros__parameters"]
    assert told["sample_time_s"] == 1e-3 and told["output_unit"] == "N·m"
    for law, held in constants().items():
        for name, value in held._asdict().items():
            if name == "plant":
                assert told[law]["plant"]["tau1_1"] == value.tau1_1
            elif name != "series":
                assert told[law][name] == value and type(told[law][name]) is type(value)


def test_plain_python_repeats_the_vectors_without_eaid(exported):
    command = [sys.executable, "-S", "-E", "check.py"]
    done = subprocess.run(command, cwd=exported("python"), capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "largest difference 0: ok" in done.stdout, done.stderr


@pytest.mark.parametrize("target", ["c", "arduino", "matlab", "fmu", "yaml", "python"])
def test_every_readme_is_one_page_with_units_and_the_list(exported, target):
    text = (exported(target) / "README.md").read_text()
    assert len(text.splitlines()) <= 70
    for word in ("Sign", "Zero", "Limits", "Watchdog", "Log", "N·m", "0.001 s", "{{"):
        assert (word in text) == (word != "{{")
    assert all(f"eaid_{law}" in text or target in ("python", "yaml", "fmu") for law in LAWS[1:2])
