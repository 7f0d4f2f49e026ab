"""The C: clean under strict compilers, the bits of the plain Python, the replay's torque, nothing but sqrt."""

import json
import re
import shutil

import numpy as np
import pytest

import eaid

from .conftest import COMPILERS, LAWS, PAPER, PLANT, STRICT, compiled, fit_of, gains_of, in_code, logged, ran

WAYS = [(compiler, level) for compiler in COMPILERS for level in ("-O0", "-O2")]
NO_CPP = pytest.mark.skipif(not shutil.which("g++"), reason="no C++ compiler")
CPP = ["g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-I.", "-fsyntax-only", "-x", "c++", "-"]


def test_a_compiler_is_there():
    """The proofs of this module are never skipped: a machine that runs the tests has gcc or clang."""
    assert COMPILERS


def rows_of(folder, *way):
    """Law, rows, and rows to the bit, as the check program tells them."""
    done = ran(compiled(folder, *way), cwd=folder)
    assert done.returncode == 0
    return re.findall(r"^(\w+) +(\d+) rows, +(\d+) to the bit, .* ok$", done.stdout, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("way", WAYS)
def test_every_row_of_the_vectors_comes_back_to_the_bit(exported, way, precision):
    rows = rows_of(exported("c", precision), *way)
    assert {name for name, _, _ in rows} == {*map(in_code, LAWS), "plant", "rate"}
    assert all(int(count) == int(exact) > 50 for _, count, exact in rows)


@pytest.mark.parametrize("precision", ["double", "single"])
def test_so_does_every_row_of_other_gains_within_narrower_limits(tmp_path, precision):
    gains = gains_of(rc={"gamma": 2.0, "epsilon": 0.4}, pi={"K_I": 0.0}, duty_limits_pct=[5.0, 95.0])
    made = eaid.export(gains, tmp_path / "c", fit_of(release=None), precision=precision, anyway=True)
    assert "export-fault-outside" in [one.code for one in made.findings]
    rows = rows_of(tmp_path / "c")
    assert len(rows) == 6 and all(count == exact for _, count, exact in rows)
    rows = [line.split(",") for line in (tmp_path / "c" / "vectors.csv").read_text().splitlines()]
    for law in LAWS:
        given = [float(row[7]) for row in rows if row[:2] == [in_code(law), "saturation"]]
        assert (min(given), max(given)) == (5.0, 95.0)


def test_a_wrong_number_in_the_vectors_is_seen(exported, tmp_path):
    folder = tmp_path / "wrong"
    shutil.copytree(exported("c"), folder, ignore=shutil.ignore_patterns("check-*"))
    text = (folder / "vectors.h").read_text()
    one = re.search(r"eaid_rc_vectors\[\] = \{\n.*?\n.*?, (-?0x[^,]+), 8U\}", text)
    (folder / "vectors.h").write_text(text[: one.start(1)] + "0x1.8f00000000001p+6" + text[one.end(1) :])
    done = ran(compiled(folder), cwd=folder)
    assert done.returncode == 1 and re.search(r"^rc .*FAILS$", done.stdout, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("law", LAWS)
def test_the_closed_loop_has_the_bits_of_the_plain_python(exported, laws, played, law, precision):
    run = played("multisine", law)
    expected = np.array(list(laws(precision).closed_loop(run)), dtype=float)
    for way in WAYS:
        assert np.array_equal(logged([compiled(exported("c", precision), *way)], run)[:, 1:3], expected)


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("steps", "sweep", "rehab")]


@pytest.mark.parametrize("name", ["multisine", *SLOW])
@pytest.mark.parametrize("law", LAWS)
def test_plant_and_controllers_in_one_simulation_agree_with_the_replay(exported, played, law, name):
    run = played(name, law)
    for precision, most in (("double", 1e-12), ("single", 1e-5)):
        assert np.abs(logged([compiled(exported("c", precision))], run)[:, 2] - run.torque).max() <= most


@pytest.mark.slow
@pytest.mark.parametrize("law", [(law,) for law in (*LAWS, "plant")])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_each_law_compiles_alone(exported, law, precision):
    assert ran(compiled(exported("c", precision, law)), cwd=exported("c")).returncode == 0


def test_nothing_but_sqrt_is_called_nothing_is_kept_outside_the_state_and_fast_math_is_refused(exported):
    folder = exported("c")
    assert ran(COMPILERS[0], *STRICT, "-O0", "-c", "eaid_control.c", "-o", "bare.o", cwd=folder).returncode == 0
    kinds = [line.split()[-2:] for line in ran("nm", "bare.o", cwd=folder).stdout.splitlines()]
    (folder / "bare.o").unlink()
    assert {name for kind, name in kinds if kind == "U"} <= {"sqrt"}
    assert not [name for kind, name in kinds if kind in "bBdDcC"]
    done = ran(COMPILERS[0], "-ffast-math", "-fsyntax-only", "eaid_control.c", cwd=folder)
    assert done.returncode != 0 and "NaN" in done.stderr


BOARD = """
#include <stdint.h>
enum { A0 = 14, INPUT_PULLUP = 2, OUTPUT = 1, LOW = 0 };
int analogRead(int); void analogWrite(int, int); int digitalRead(int); void pinMode(int, int);
unsigned long micros();
struct Port { void begin(long); void println(const char *); void println(double, int); void print(double, int);
              void print(char); int available(); int read(); } Serial;
"""


@NO_CPP
@pytest.mark.parametrize("laws", [None, ("pi",), ("inverse",)])
def test_the_sketch_compiles_against_a_board_that_has_its_functions(exported, laws):
    folder = exported("arduino", "single", laws)
    (sketch,) = folder.glob("*.ino")
    assert sketch.stem == folder.name
    done = ran(*CPP, cwd=folder, input=BOARD + sketch.read_text())
    assert done.returncode == 0, done.stderr
    assert ran(COMPILERS[0], "-DARDUINO=100", "-c", "check.c", "-o", "/dev/null", cwd=folder).returncode == 0


@pytest.mark.parametrize("law", LAWS)
def test_a_log_of_the_exported_code_is_read_back_without_options(exported, tmp_path, law, monkeypatch, run_eaid):
    monkeypatch.chdir(tmp_path)
    log = ran(compiled(exported("c")), "log", in_code(law), cwd=tmp_path).stdout
    assert log.startswith("time_s,duty_pct,torque_nm,reference_nm\n0,")
    for name, text in (("rig.csv", log), ("fit.json", json.dumps(PLANT)), ("gains.json", json.dumps(PAPER))):
        (tmp_path / name).write_text(text)
    done = run_eaid("simulate", "fit.json", "--gains", "gains.json", "--log", "rig.csv", "--json", "-q", "-o", "r.h5")
    assert done.code == 0
    (told,) = json.loads(done.out)["log"].values()
    assert told["max_abs_difference_nm"] < 1e-12


def test_logs_of_the_exported_plant_are_fitted_without_options_and_give_it_back(exported, tmp_path):
    for duty in range(10, 101, 10):
        log = ran(compiled(exported("c")), "log", "plant", str(duty), cwd=tmp_path).stdout
        (tmp_path / f"hil-{duty:03d}.csv").write_text(log)
    found = eaid.fit(tmp_path).nonlinear
    for name in ("tau1", "Ts"):
        assert getattr(found, name) == pytest.approx(PLANT["nonlinear"][name], rel=2e-3, abs=1e-4)


def test_a_slow_plant_is_logged_until_it_is_there(tmp_path):
    """Once 17 s of any rig: of one of 3000 s nothing but zeros."""
    slow = fit_of(nonlinear={"tau1": [3000.0, 0, 0], "tau2": [3000.0, 0, 0]}, release=None)
    eaid.export(gains_of(), tmp_path / "c", slow, rate_hz=1.0, law=("pi", "plant"), anyway=True)
    log = np.loadtxt(
        ran(compiled(tmp_path / "c"), "log", "plant", "60", cwd=tmp_path).stdout.splitlines(), delimiter=",", skiprows=1
    )
    assert log[-1, 0] > 4 * 3000 and log[-1, 2] == pytest.approx(slow.plant.steady(60.0), rel=0.01)


@pytest.mark.skipif(not shutil.which("valgrind"), reason="no valgrind")
def test_valgrind_finds_nothing(exported):
    program = compiled(exported("c"), "", "-O0")
    assert ran("valgrind", "-q", "--error-exitcode=9", "--leak-check=full", program, cwd=exported("c")).returncode == 0


FAULTS = """
#include <stdio.h>
#include "eaid_control.h"
int main(void)
{
    %(state)s s;
    eaid_real duty;
    printf("%%u %%u\\n", (unsigned)eaid_interval(1.05F * eaid_dt_s), (unsigned)eaid_interval(1.2F * eaid_dt_s));
    printf("%%u\\n", (unsigned)eaid_%(law)s_init(&eaid_%(law)s, &s, 2 * eaid_dt_s));
    duty = eaid_%(law)s_step(&eaid_%(law)s, &s, 1, 0, 0);
    printf("%%g %%u\\n", (double)duty, (unsigned)s.guard.status);
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("law", LAWS)
def test_a_wrong_rate_is_met_as_the_readme_says(exported, tmp_path, law, precision):
    state = "eaid_inverse_state" if law == "inverse" else "eaid_integral_state"
    (tmp_path / "faults.c").write_text(FAULTS % {"law": in_code(law), "state": state})
    folder = exported("c", precision)
    made = ran(COMPILERS[0], f"-I{folder}", "faults.c", folder / "eaid_control.c", "-o", "faults", "-lm", cwd=tmp_path)
    assert made.returncode == 0
    lines = ran(tmp_path / "faults", cwd=tmp_path).stdout.splitlines()
    assert lines == ["0 32", "32", "0 33"]
