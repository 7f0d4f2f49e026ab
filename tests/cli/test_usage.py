"""Calls that cannot mean anything: an exit code and one sentence, at once, and every file stays as it was.

A line of the table: exit code | command line | sentence, `…` standing for any rest; the output is `out` if not named.
"""

import json
import os
import shlex
import shutil

import pytest

TABLE = r"""
2 | fit data.h5 --model cubic | --model cubic: must be one of friction, nonlinear, linear
2 | fit data.h5 --model linear,linear | --model: names linear twice
2 | fit data.h5 --share most | --share most: must be free or a number
2 | fit data.h5 --hold-out a | --hold-out a: write numbers with commas between them, as 40,70
3 | fit data.h5 --bounds-levels 1:5 | --bounds-levels 1:5: no log holds 1:5; levels found: 20, 40, 60, 80, 100
2 | fit data.h5 --duty 10 | --duty 10: give two numbers, as LOW:HIGH
2 | fit data.h5 --duty 90:10 | --duty 90:10: give two numbers, the lower one first
2 | fit data.h5 --duty 10:100 | --duty: belongs to logs that are fitted as recorded, and these are steps; leave it out
2 | fit data.h5 --baseline 3:x | --baseline 3:x: write auto, first, none, a value in the output's unit, or FROM:TO in …
2 | fit data.h5 --apparatus surface=2 | --apparatus surface: must be one of inner_radius_m, outer_radius_m, surfaces, …
2 | fit data.h5 --columns "a=b\nc" | --columns 'a=b\nc': holds a line break; write all pairs on one line
2 | fit data.h5 --columns time | --columns time: write name=value pairs with commas between them, as …
2 | fit data.h5 --rate-hz 100 | --rate-hz: does nothing on data.h5, a dataset, which says all itself; leave it out
3 | fit nowhere.h5 | nowhere.h5: no such file or folder; check the path
2 | fit '' | an empty word stands among the arguments; give a file or a folder in its place
2 | fit | Missing argument 'DATA…'; see eaid fit --help
2 | ingest logs --apparatus surfaces=two | --apparatus surfaces=two: Expected int, got str: surfaces
2 | ingest logs --apparatus outer_radius_m=0.01 | --apparatus outer_radius_m=0.01: an inner radius of 0.04 m …
2 | ingest logs --columns time=a,time=b | --columns time=a,time=b: says time twice
2 | ingest logs --columns output=torque_nm,input=3 | --columns: input and output are the same column, torque_nm
2 | ingest logs --columns torque=3 | --columns and --units know time, input, output, reference and position, not torque
2 | ingest logs --units time=N | --units time=N: is no unit of time; use s, ms, us, ns, min, h or d
2 | ingest logs --units output=ms | --units output=ms: is a unit of time, not of the output
2 | ingest logs --units input=/0 | --units input=/0: write a number from 1e-12 to 1e12 behind the stroke, as in /255
2 | ingest logs --name-pattern {level}{level} | --name-pattern {level}{level}: holds a field twice
2 | ingest logs -o no/such/data.h5 | no/such/data.h5: the folder no/such does not exist; make it first
3 | ingest pipe.csv | pipe.csv: is no plain file; give a log or a folder of logs
2 | tune-rc fit.json --pi-overshoot 1 | --pi-overshoot and --pi-settling belong together: give both or neither
2 | tune-rc fit.json --pi-gains 21 | --pi-gains 21: give two numbers, as K_P,K_I
2 | tune-rc fit.json --b-hat best | --b-hat best: must be pooled, minimax or a number
2 | tune-rc fit.json --phi much | --phi much: must be data or a number
2 | tune-rc fit.json --kp 4 --damping 1 | give either --kp and --kd, or --natural-frequency and --damping, not both
2 | tune-rc fit.json --duty-limits 0,120 | --duty-limits 0,120: a duty ends at 100 %
3 | tune-rc nowhere.json -o fit.json | nowhere.json: no such file; give the fit.json that eaid wrote
3 | couple fit.json nowhere.json -o fit.json | nowhere.json: no such file; give the gains.json that eaid wrote
3 | tune-rc gains.json | gains.json: is no fit of eaid (its schema is 'eaid/gains/1'); give the fit.json that eaid …
5 | tune-rc fit.json --pi-overshoot 1 --pi-settling 0.001 | the PI loop is unstable on the fitted model around …
5 | tune-rc fit.json --epsilon 1e-4 --gamma 9e4 | the RC loop is unstable on the fitted model around …
2 | simulate fit.json --scenario jumps | --scenario jumps: must be one of multisine, steps, sweep, rehab
2 | simulate fit.json --controller rc | controller rc needs gains: give --gains, which eaid tune-rc writes
2 | simulate fit.json --gains gains.json --controller smith | controller smith: the gains hold only rc, pi…
2 | simulate fit.json --scenario steps --reference reference.csv | --scenario, --reference and --log exclude each …
2 | simulate fit.json --scenario sweep --duration 3 | the sweep's length follows from its frequencies; leave …
2 | simulate fit.json --plants 5 --scenario rehab | --plants: goes with steps, multisine, sweep or --reference; leave …
2 | simulate fit.json --limb-damping 1 | --limb-damping: belongs to --scenario rehab; leave it out
2 | simulate fit.json --log data.h5 --rate-hz 100 | --rate-hz: does not go with --log, which has a rate of its own; …
2 | simulate fit.json --log data.h5 --noise-nm 0.1 | --noise-nm: does nothing with logs; leave it out
2 | simulate fit.json --columns time=T | --columns, --units, --repair and --variable belong to --log; leave them out
3 | simulate force.json | the fit holds no nonlinear model, which the replay's plant is; fit clutch data with it
2 | plan fit.json --want tau9=3 | --want tau9: give a parameter of Ts, tau1, tau2 and a half-width in percent, above …
2 | plan fit.json --limits rest=5 | --limits: does nothing without --excitation; leave it out
2 | plan fit.json --excitation --most-levels 5 | --most-levels: does nothing with --excitation; leave it out
2 | plan fit.json --excitation --limits rest_s=1e300 | --limits rest_s 1e+300: give a number from 0 to 1e+09
2 | plan fit.json --excitation --limits dutty=10:100 | --limits dutty: must be one of duty, engagements, hold_s, …
2 | synth --levels ten | --levels ten: give levels as 30,40,90 or as from:to:step
2 | synth --levels 10:100:7 | --levels 10:100:7: the step does not lead from 10 to 100
2 | synth --duty-file duty.csv --hold 3 | --duty-file: says levels and times itself; leave out --levels, --idle, …
2 | synth --duty-file duty.csv --excitation random -o out | --duty-file and --excitation exclude each other; give …
3 | synth --duty-file nowhere.csv | nowhere.csv: no such file; give a CSV time_s,duty_pct
3 | synth --plant force.json --kind clutch | force.json (sha256 …
2 | synth --excitation random -o new.h5 | --excitation: writes a folder of CSV (-o FOLDER); give another -o
2 | synth --excitation random --shape colour=3 -o new | --shape colour: must be one of duration_s, duty, …
2 | synth --excitation random --shape hold_s=3 -o new | --shape hold_s 3: give two numbers, as 0.3:30
2 | synth --excitation staircase --shape levels=2.5 -o new | --shape levels 2.5: give a whole number from 2 to 10000
2 | synth --excitation chirp --rate-hz 8 -o new | --rate-hz 8: must be 10 Hz or more for --excitation chirp
3 | export nowhere.json | nowhere.json: no such file; give the gains.json that eaid wrote
3 | export text.json | text.json: is not a JSON file (Expecting value: line 1 column 1 (char 0)); give a resu…
3 | export plan.json | plan.json: is neither gains.json nor fit.json; give what eaid tune-rc or eaid fit wrote
3 | tune-rc force.json | the fit is one of friction-force, which no loop drives; where its input is yours to …
3 | export force.json | force.json: holds no plant; fit clutch logs with a nonlinear model, or logs as recorded
2 | export gains.json --duty-on-fault 900 -o x | --duty-on-fault 900: every fault would give it, and the actuator …
2 | export gains.json gains.json | gains.json: a second gains.json; give one gains.json and one fit.json at most
2 | export gains.json --law pid | --law pid: must be one of pi, rc, pi-feedforward, inverse, plant; did you mean pi?
2 | export gains.json -o no/where | no/where: the folder …
2 | export gains.json -o logs --force | logs: holds log.csv, which eaid export did not make; give another --output
2 | couple fit.json --limb-damping 0 | --limb-damping 0: give a number above 0, …
2 | report fit.json --figures fig99 | --figures fig99: no such figure; there are fig02_pwm, fig06_hold_and_release, …
3 | report nowhere.json | nowhere.json: no such file; give a fit.json, gains.json, couple.json, replay.h5 or data.h5
2 | demo -o logs | logs: is not empty; give --force to write over it, or another -o
2 | demo -o fit.json | fit.json: is a file; give the demo a folder with -o
2 | fitt | no such command fitt: must be one of ingest, fit, …
2 | fit data.h5 --modle linear | No such option: --modle (Possible options: --model); see eaid fit --help
2 | export gains2.json --law plant | --law plant needs what was not given: fit.json with a nonlinear model, --fit
5 | export gains2.json -o out | PI: the loop is unstable at 1000 Hz around 50 %; ask for slower gains; --anyway …
2 | fit data.h5 --units "input=\udcff" | 'input=\udcff': is not UTF-8; type it in a terminal that writes UTF-8
3 | couple force.json | the fit holds no nonlinear model, which walls are worked out on; fit clutch logs with it
"""


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    """`made`, and beside it gains whose PI is unstable and that name no fit, and a pipe."""
    folder = tmp_path_factory.mktemp("usage") / "rig"
    shutil.copytree(made, folder)
    gains = json.loads((folder / "gains.json").read_text())
    del gains["inputs"], gains["digest"]
    gains["pi"]["K_P"] = 3e5
    (folder / "gains2.json").write_text(json.dumps(gains))
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe.csv")
    return folder


@pytest.fixture(autouse=True)
def _nothing_changes(folder, monkeypatch, held):
    monkeypatch.chdir(folder)
    before = held(folder)
    yield
    assert held(folder) == before


@pytest.mark.parametrize("row", TABLE.strip().splitlines())
def test_such_a_call_is_refused_in_one_sentence(row, run_eaid):
    code, line, sentence = row.split(" | ", 2)
    words = shlex.split(line.replace(r"\n", "\n").replace(r"\udcff", "\udcff"))
    if len(words) > 1 and "-o" not in words and "Possible options" not in sentence:
        words += ["-o", "out.h5" if words[0] in ("ingest", "synth") else "out"]
    ran = run_eaid(words)
    (told,) = [one for one in ran.err.splitlines() if one.startswith("error: ")]
    start, cut, _ = sentence.partition("…")
    assert (ran.code, ran.out) == (int(code), "")
    assert told.removeprefix("error: ").startswith(start) if cut else told == f"error: {sentence}"
    assert "Traceback" not in ran.err
