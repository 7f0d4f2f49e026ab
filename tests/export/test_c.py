"""The C: clean under strict compilers, the bits of the plain Python, nothing but sqrt, no state of its own."""

import json
import re
import shutil
import subprocess
import sys

import msgspec
import numpy as np
import pytest
import yaml
from fmpy.validation import validate_fmu

from eaid.cli import main
from eaid.export import job
from eaid.results.common import Input

from .conftest import (
    COMPILERS,
    LAWS,
    STRANGE,
    STRANGE_PI,
    STRANGE_RC,
    STRICT,
    closed_loop,
    compiled,
    export,
    fit_of,
    gains_of,
    logged,
)

WAYS = [(compiler, level) for compiler in COMPILERS for level in ("-O0", "-O2")]


def test_a_compiler_is_there():
    """The proofs of this module are never skipped: a machine that runs the tests has gcc or clang."""
    assert COMPILERS


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize(("compiler", "level"), WAYS)
def test_every_row_of_the_vectors_comes_back_to_the_bit(exported, compiler, level, precision):
    program = compiled(exported("c", precision), compiler, level)
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    rows = re.findall(r"^(\w+) +(\d+) rows, +(\d+) to the bit, .* ok$", done.stdout, re.MULTILINE)
    assert {name for name, _, _ in rows} == {*LAWS, "plant", "rate"}
    assert all(int(count) == int(exact) > 50 for _, count, exact in rows)


@pytest.mark.parametrize("precision", ["double", "single"])
def test_so_does_every_row_of_a_rig_that_is_at_every_floor(tmp_path, precision, monkeypatch):
    monkeypatch.setattr(job, "plant_of", lambda fit: fit.plant)  # it would refuse the rig
    options = {"precision": precision, "folder": tmp_path / "c", "anyway": True}
    export(gains_of(STRANGE_RC, STRANGE_PI), fit_of(STRANGE), options)
    done = subprocess.run([compiled(tmp_path / "c", COMPILERS[0])], capture_output=True, text=True, check=True)
    rows = re.findall(r"^\w+ +(\d+) rows, +(\d+) to the bit, .* ok$", done.stdout, re.MULTILINE)
    assert len(rows) == 5 and all(count == exact for count, exact in rows)
    if shutil.which("octave"):
        export(gains_of(STRANGE_RC, STRANGE_PI), fit_of(STRANGE), dict(options, target="matlab", folder=tmp_path / "m"))
        command = ["octave", "--no-gui", "-q", "--norc", "--eval", "check();"]
        done = subprocess.run(command, cwd=tmp_path / "m", capture_output=True, text=True, check=False)
        assert "largest difference 0, wrong status 0" in done.stdout


def test_a_wrong_number_in_the_vectors_is_seen(exported, tmp_path):
    folder = tmp_path / "wrong"
    shutil.copytree(exported("c"), folder, ignore=shutil.ignore_patterns("check-*"))
    text = (folder / "vectors.h").read_text()
    one = re.search(r"eaid_rc_vectors\[\] = \{\n.*?\n.*?, (-?0x[^,]+), 8U\}", text)
    head, tail = text[: one.start(1)], text[one.end(1) :]
    (folder / "vectors.h").write_text(head + "0x1.8f00000000001p+6" + tail)
    done = subprocess.run([compiled(folder, COMPILERS[0])], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and re.search(r"^rc .*FAILS$", done.stdout, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("law", LAWS)
def test_the_closed_loop_has_the_bits_of_the_plain_python(exported, played, law, precision):
    run = played("multisine", law)
    expected = np.array([[float(duty), float(torque)] for duty, torque in closed_loop(run, precision)])
    for compiler, level in WAYS:
        found = logged(compiled(exported("c", precision), compiler, level), run)
        assert np.array_equal(found[:, 1:3], expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["steps", "multisine", "sweep", "rehab"])
@pytest.mark.parametrize("law", LAWS)
def test_plant_and_controllers_in_one_simulation_agree_with_the_replay(exported, played, law, name):
    run = played(name, law)
    double = logged(compiled(exported("c"), COMPILERS[0]), run)
    assert np.abs(double[:, 2] - run.torque).max() <= 1e-12
    single = logged(compiled(exported("c", "single"), COMPILERS[0]), run)
    assert np.abs(single[:, 2] - run.torque).max() <= 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("law", [(law,) for law in (*LAWS, "plant")])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_each_law_compiles_alone(exported, law, precision):
    done = subprocess.run([compiled(exported("c", precision, law), COMPILERS[0])], capture_output=True, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize("target", ["c", "arduino"])
def test_nothing_but_sqrt_is_called_and_nothing_is_kept_outside_the_state(exported, target):
    folder = exported(target)
    subprocess.run([COMPILERS[0], *STRICT, "-O0", "-c", "eaid_control.c", "-o", "bare.o"], cwd=folder, check=True)
    symbols = subprocess.run(["nm", "bare.o"], cwd=folder, capture_output=True, text=True, check=True).stdout
    (folder / "bare.o").unlink()
    kinds = [line.split()[-2:] for line in symbols.splitlines()]
    assert {name for kind, name in kinds if kind == "U"} <= {"sqrt"}
    assert not [name for kind, name in kinds if kind in "bBdDcC"]


@pytest.mark.skipif(not shutil.which("g++"), reason="no C++ compiler")
def test_the_header_is_safe_for_cpp(exported):
    body = "eaid_integral_state s; (void)eaid_rc_init(&eaid_rc, &s, eaid_dt_s); return 0;"
    text = f'#include "eaid_control.h"\nint main() {{ {body} }}'
    command = ["g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", "-x", "c++", "-"]
    done = subprocess.run(command, cwd=exported("c"), input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_fast_math_is_refused_by_the_source_itself(exported):
    command = [COMPILERS[0], "-ffast-math", "-fsyntax-only", "eaid_control.c"]
    done = subprocess.run(command, cwd=exported("c"), capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "NaN" in done.stderr


def test_the_makefile_works(exported, tmp_path):
    folder = tmp_path / "made"
    shutil.copytree(exported("c"), folder, ignore=shutil.ignore_patterns("check-*"))
    done = subprocess.run(["make", f"CC={COMPILERS[0]}"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stdout.count(": ok") == 5


@pytest.mark.skipif(not shutil.which("g++"), reason="no C++ compiler")
@pytest.mark.parametrize("laws", [None, ("pi",), ("inverse",)])
def test_the_sketch_compiles_against_a_board_that_has_its_functions(exported, laws):
    folder = exported("arduino", "single", laws)
    (sketch,) = folder.glob("*.ino")
    assert sketch.stem == folder.name
    board = """
    #include <stdint.h>
    enum { A0 = 14, INPUT_PULLUP = 2, OUTPUT = 1, LOW = 0 };
    int analogRead(int); void analogWrite(int, int); int digitalRead(int); void pinMode(int, int);
    unsigned long micros();
    struct Port { void begin(long); void println(const char *); void println(double, int); void print(double, int);
                  void print(char); int available(); int read(); } Serial;
    """
    text = board + sketch.read_text()
    command = ["g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-I.", "-fsyntax-only", "-x", "c++", "-"]
    done = subprocess.run(command, cwd=folder, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    nothing = [COMPILERS[0], "-DARDUINO=100", "-c", "check.c", "-o", "/dev/null"]
    assert subprocess.run(nothing, cwd=folder, check=False).returncode == 0


@pytest.mark.parametrize("law", LAWS)
def test_a_log_of_the_exported_code_is_read_back_without_options(exported, tmp_path, law, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    done = subprocess.run([compiled(exported("c"), COMPILERS[0]), "log", law], capture_output=True, check=True)
    (tmp_path / "rig.csv").write_bytes(done.stdout)
    assert done.stdout.startswith(b"time_s,duty_pct,torque_nm,reference_nm\n0,")
    _written(tmp_path)
    command = ["simulate", "fit.json", "--gains", "gains.json", "--log", "rig.csv", "--json", "-q", "-o", "replay.h5"]
    assert main.run(command) == 0
    (told,) = json.loads(capsys.readouterr().out)["log"].values()
    assert told["max_abs_difference_nm"] < 1e-12


def _written(folder) -> None:
    """fit.json and gains.json of a user's script."""
    for name, result in (("fit", fit_of()), ("gains", gains_of())):
        (folder / f"{name}.json").write_text(json.dumps(msgspec.to_builtins(result)))


def test_logs_of_the_exported_plant_are_fitted_without_options_and_give_it_back(exported, tmp_path):
    program, logs = compiled(exported("c"), COMPILERS[0]), tmp_path / "logs"
    logs.mkdir()
    for duty in range(10, 101, 10):
        done = subprocess.run([program, "log", "plant", str(duty)], capture_output=True, check=True)
        (logs / f"hil-{duty:03d}.csv").write_bytes(done.stdout)
    assert main.run(["fit", str(logs), "-q", "-o", str(tmp_path / "fit.json")]) in (0, 4)
    found = json.loads((tmp_path / "fit.json").read_text())["nonlinear"]
    plant = fit_of().nonlinear
    for name in ("tau1", "Ts"):
        assert found[name] == pytest.approx(getattr(plant, name), rel=2e-3, abs=1e-4)


def test_the_duty_limits_of_the_gains_are_kept(tmp_path):
    made = export(gains_of(duty_limits_pct=[10.0, 80.0]), fit_of(), {"folder": tmp_path / "x"})
    rows = [line.split(",") for line in (tmp_path / "x" / "vectors.csv").read_text().splitlines()[1:]]
    given = {law: [float(row[7]) for row in rows if row[0] == law and row[1] == "saturation"] for law in LAWS}
    for duties in given.values():
        assert min(duties) == 10.0 and max(duties) == 80.0
    assert [one.code for one in made.findings if one.code == "export-fault-outside"]


@pytest.mark.skipif(not shutil.which("valgrind"), reason="no valgrind")
def test_valgrind_finds_nothing(exported):
    program = compiled(exported("c"), COMPILERS[0], "-O0")
    command = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", str(program)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


FAULTS = """
#include <stdio.h>
#include "eaid_control.h"
int main(void)
{
    %(state)s s;
    eaid_real duty;
    int k;
    printf("%%u %%u\\n", (unsigned)eaid_interval(1.05F * eaid_dt_s), (unsigned)eaid_interval(1.2F * eaid_dt_s));
    printf("%%u\\n", (unsigned)eaid_%(law)s_init(&eaid_%(law)s, &s, 2 * eaid_dt_s));
    duty = eaid_%(law)s_step(&eaid_%(law)s, &s, 1, 0, 0);
    printf("%%g %%u\\n", (double)duty, (unsigned)s.guard.status);
    (void)eaid_%(law)s_init(&eaid_%(law)s, &s, eaid_dt_s);
    for (k = 0; k < 700; k++)
    {
        duty = eaid_%(law)s_step(&eaid_%(law)s, &s, 2, 0, k < 100 ? (eaid_real)k / 100 : (eaid_real)1);
        if ((k == 599) || (k == 600) || (k == 699))
        {
            printf("%%.6g %%u\\n", (double)duty, (unsigned)s.guard.status);
        }
    }
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("law", LAWS)
def test_a_wrong_rate_and_a_stuck_sensor_are_met_as_the_readme_says(exported, tmp_path, law, precision):
    state = "eaid_inverse_state" if law == "inverse" else "eaid_integral_state"
    (tmp_path / "faults.c").write_text(FAULTS % {"law": law, "state": state})
    folder = exported("c", precision)
    command = [COMPILERS[0], "-O2", f"-I{folder}", "faults.c", str(folder / "eaid_control.c"), "-o", "faults", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "faults"], capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[:3] == ["0 32", "32", "0 33"]
    stuck = [line.split() for line in said[3:]]
    assert [int(status) & 16 for _, status in stuck] == [0, 16, 16]  # 500 samples after the last change
    assert float(stuck[2][0]) == 100.0 and int(stuck[2][1]) == 24  # the error stays: the duty is at its limit


@pytest.mark.slow
def test_no_name_of_a_file_or_a_unit_breaks_the_sources(tmp_path):
    named = (Input('evil */ int x; /* """ \\', "abc"), Input("two\nlines", "def"))
    data = {"input_unit": 'V */ "', "output_unit": "N\n<m>", "levels": [100.0]}
    for target in ("c", "python", "yaml", "fmu"):
        options = {"target": target, "folder": tmp_path / target, "inputs": named, "command": "eaid export 'a\\"}
        export(gains_of(), fit_of(data=data), options)
    assert subprocess.run([compiled(tmp_path / "c", COMPILERS[0])], capture_output=True, check=False).returncode == 0
    assert subprocess.run(["make"], cwd=tmp_path / "c", capture_output=True, check=False).returncode == 0
    assert subprocess.run([sys.executable, "check.py"], cwd=tmp_path / "python", check=False).returncode == 0
    assert yaml.safe_load((tmp_path / "yaml" / "parameters.yaml").read_text())
    assert validate_fmu(str(tmp_path / "fmu" / "eaid_rc.fmu")) == []
