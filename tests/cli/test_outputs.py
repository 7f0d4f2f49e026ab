"""What every command does with files: nothing is replaced that is read, that exists already, or that is no file.
And what it prints: `--json` is the file, `-q` says nothing, the same call gives the same bytes."""

import json
import os
import shlex
import shutil
from pathlib import Path

import pytest

READS = """
logs/log.csv: ingest logs/log.csv -o OUT
logs/log.csv: ingest logs -o OUT
logs/log.csv: fit logs -o OUT
data.h5: fit data.h5 -o OUT
sets/data.h5: fit sets -o OUT
fit.json: tune-rc fit.json -o OUT
reference.csv: tune-rc fit.json --reference reference.csv -o OUT
fit.json: simulate fit.json --scenario steps -o OUT
gains.json: simulate fit.json --gains gains.json --scenario steps -o OUT
reference.csv: simulate fit.json --reference reference.csv -o OUT
logs/log.csv: simulate fit.json --log logs -o OUT
fit.json: couple fit.json -o OUT
gains.json: couple fit.json --gains gains.json -o OUT
fit.json: plan fit.json --no-check -o OUT
fit.json: plan fit.json --excitation --no-check -o OUT
fit.json: synth --plant fit.json -o OUT.h5
duty.csv: synth --duty-file duty.csv -o OUT.h5
report.html: report report.html -o .
"""


@pytest.mark.parametrize(
    ("line", "way"),
    [(line, "itself") for line in READS.strip().splitlines()]
    + [(READS.strip().splitlines()[k], way) for k, way in ((0, "symlink"), (4, "hard link"))],
)
def test_a_command_never_replaces_what_it_reads(line, way, rig, run_eaid, held):
    (rig / "sets").mkdir()
    shutil.copy("data.h5", "sets/data.h5")
    shutil.copy("fit.json", "report.html")
    read, words = line.split(": ")
    out = read
    if "OUT.h5" in words:  # a command that tells its output's kind by its name
        out = f"{read}.h5"
        shutil.move(read, out)
        words, read = words.replace(read, out).replace("OUT.h5", "OUT"), out
    if way != "itself" and "OUT" in words:
        out = "other" + Path(read).suffix
        (os.symlink if way == "symlink" else os.link)(read, out)
    before = held(rig)
    ran = run_eaid(*shlex.split(words.replace("OUT", out)), "--force", "-q")
    assert ran.code == 2
    assert "is what the command reads, and is never overwritten; give another --output" in ran.err
    assert held(rig) == before


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ("duty.csv: out/synthetic-duty.csv", "synth --duty-file out/synthetic-duty.csv -o out"),
        ("gains.json: out/parameters.json", "export out/parameters.json --anyway -o out"),
        ("fit.json: out/parameters.json", "export gains.json out/parameters.json --anyway -o out"),
    ],
)
def test_a_folder_that_holds_what_is_read_is_not_replaced(given, line, rig, run_eaid, held):
    (rig / "out").mkdir()
    shutil.copy(*given.split(": "))
    before = held(rig)
    ran = run_eaid(line, "--force", "-q")
    assert ran.code == 2 and "which the command reads; give another --output" in ran.err
    assert held(rig) == before


LINES = {
    "ingest data.h5": "data.h5", "fit data.h5": "fit.json", "tune-rc fit.json": "gains.json",
    "simulate fit.json --scenario steps": "replay.h5", "couple fit.json": "couple.json",
    "plan fit.json --no-check": "plan.csv", "plan fit.json --excitation --no-check": "plan.csv",
    "synth": "synthetic.h5", "export gains.json --anyway": "export", "report fit.json": "report", "demo": "demo",
}  # fmt: skip
"""Command → its output where none is named."""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name here")
@pytest.mark.parametrize(("line", "out"), [*((line, "../pipe") for line in LINES), ("fit data.h5", "/dev/null")])
def test_devices_and_pipes_are_never_replaced(line, out, rig, run_eaid):
    os.mkfifo("../pipe")
    ran = run_eaid(line, "-o", out, "--force")
    assert ran.code == 2 and "\nerror: " in "\n" + ran.err
    assert Path("../pipe").is_fifo() and Path("/dev/null").is_char_device()


@pytest.mark.parametrize("line", [line for line in LINES if line != "demo"])
def test_an_earlier_result_is_left_alone(line, rig, run_eaid, held):
    """By its default name, and beside the second file that a plan writes."""
    out = Path(LINES[line])
    if not out.suffix:
        out.mkdir(exist_ok=True)
    earlier = {"export": "export/README.md", "report": "report/report.html"}.get(LINES[line], LINES[line])
    Path(earlier).exists() or Path(earlier).write_text("# export, made by eaid 0.1.0")
    before = held(rig)
    ran = run_eaid(line)
    told = [one for one in ran.err.splitlines() if one.startswith("error: ")]
    assert ran.code == 2 and len(told) == 1
    named = earlier if out.suffix or "report" in line else out
    assert told[0].startswith(f"error: {named}: exists already; give --force")
    assert held(rig) == before


def test_the_second_file_of_a_plan_is_left_alone_too(rig, run_eaid):
    Path("p.duty.csv").write_text("mine")
    ran = run_eaid("plan fit.json -o p.csv --no-check")
    assert ran.code == 2 and "p.duty.csv: exists already" in ran.err
    assert Path("p.duty.csv").read_text() == "mine" and not Path("p.csv").exists()


QUICK = {
    "ingest logs -o OUT.h5": "eaid/ingest/1",
    "fit data.h5 --ci none -o OUT.json": "eaid/fit/2",
    "tune-rc fit.json --pi-overshoot 1 --pi-settling 0.27 -o OUT.json": "eaid/gains/1",
    "simulate fit.json --gains gains.json --duration 2 --plants 3 --noise-nm 0.01 -o OUT.h5": "eaid/replay/1",
    "couple fit.json --torque 1 --no-replay -o OUT.json": "eaid/couple/1",
    "plan fit.json --no-check --want Ts=4 -o OUT.csv": "eaid/plan/1",
    "synth --levels 40,90 --repeats 2 --rate-hz 50 -o OUT.h5": "eaid/synth/1",
    "export gains.json --law pi,rc --as yaml -o OUT": "",
    "report gains.json -o OUT": "",
}


@pytest.mark.parametrize("line", QUICK)
def test_json_is_the_result_and_quiet_is_quiet_and_the_bytes_are_the_same(line, rig, run_eaid, held):
    """Over an earlier file with --force; the second time without a word."""
    (rig / "out").mkdir()
    words = line.replace("OUT", "out/x").split()
    out = Path(words[-1])
    if out.suffix:
        out.write_text("mine")
    ran = run_eaid(words, "--force", "--json")
    assert ran.code == 0 and f"{out}" in ran.err.splitlines()[-1]
    told, first = json.loads(ran.out), held(rig / "out")
    assert told.get("schema", "") == QUICK[line]
    if out.suffix == ".json":
        assert ran.out == out.read_text(encoding="utf-8")
    assert first and all(content != b"mine" for content in first.values())
    shutil.rmtree("out")
    Path("out").mkdir()
    again = run_eaid(words, "-q")
    assert (again.code, again.out, again.err) == (0, "", "")
    assert held(rig / "out") == first


@pytest.mark.parametrize("line", ["ingest logs -o d.h5", "tune-rc fit.json -o g.json", "report gains.json -o r"])
def test_a_full_disk_leaves_the_earlier_output_whole(line, rig, run_eaid, held, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    earlier = Path("r/report.html" if "report" in line else line.split()[-1])
    earlier.parent.mkdir(exist_ok=True)
    earlier.write_bytes(b"earlier")
    before = held(rig)
    monkeypatch.setattr(os, "fsync", full)
    ran = run_eaid(line, "-q", "--force")
    wanted = "cannot be written (No space left on device); make room, or choose another --output"
    assert (ran.code, ran.err) == (2, f"error: {earlier}: {wanted}\n") and held(rig) == before


AGAIN = """
fit logs --share free --ci white --dead-time 0 --logs-as steps --baseline first --estimator joint --seed 3
tune-rc fit.json --kp 9 --kd 4 --epsilon 0.3 --gamma 60 --q-max 7 --b-hat 15 --rho textbook --pi-gains 30,100 --pwm-hz 0
couple fit.json --gains gains.json --torque 1,2 --loops pi,rc --no-replay --delay-samples 1 --limb-inertia 0.2
"""


@pytest.mark.parametrize("line", AGAIN.strip().splitlines())
def test_the_words_that_a_result_keeps_make_it_again(line, rig, run_eaid):
    words = line.split()
    assert run_eaid(words, "-q", "-o", "a.json").code in (0, 4)
    first = json.loads(Path("a.json").read_text(encoding="utf-8"))
    assert {word for word in words if word.startswith("--")} <= set(first["command"])
    assert run_eaid(words[0], *first["command"], "-q", "-o", "b.json").code in (0, 4)
    assert Path("a.json").read_bytes() == Path("b.json").read_bytes()
