"""Logs of one call: what a folder holds, what their names say, copies, fractions."""

import gzip
import itertools
import os
import shlex
import shutil
import sys

import numpy as np
import pandas as pd
import pytest
from logs_written import frame, text

import eaid
from eaid import DataError, UsageError
from eaid.logs.names import pattern_guessed

T = np.arange(1000) / 100.0
U = np.where((T >= 2) & (T < 7), 50.0, 0.0)
RISE = -np.expm1(-np.maximum(T - 2, 0) / 0.3)
Y = np.where(T >= 7, RISE * np.exp(-np.maximum(T - 7, 0) / 0.5), RISE) + 0.1
LOG = text("time_s,duty_pct,torque_nm", T[::10], U[::10], np.round(Y[::10], 6))
OTHER = text("time_s,duty_pct,torque_nm", T[::10], U[::10], np.round(1.1 * Y[::10], 6))
PROSE = "Session of 3 May, rig 2.\nDisc 3 was changed after run 7, and run 12 is odd: 20 % came late.\n\nAsk Anna.\n"

BESIDE: dict[str, bytes] = {
    "notes.txt": PROSE.encode(), "README": b"# Logs\n\nRecorded with QuaRC at 1 kHz.\n",
    "liesmich.txt": "Übung 1: Größe der Last, 3 kg.\n".encode("latin-1"), "notes16.txt": PROSE.encode("utf-16"),
    "to do.log": b"1. clean discs\n2. check the belt\n3. call\n",
    "people.txt": b"name\tmail\nAnna\tanna@lab\nBen\tben@lab\n",
    "two rows.txt": b"a note\n0,1,2\n1,2,3\nand words\n2,3,4\n3,4,5\n", "rig.jpeg2": b"\xff\xd8\xff\xe0 picture",
    "paper": b"%PDF-1.7 paper", "model.slxc": b"PK\x03\x04 a Simulink cache", "results.xlsx": b"PK\x03\x04 a workbook",
    "old.xls": b"\xd0\xcf\x11\xe0 a workbook", "firmware.bin": bytes(range(256)) * 8,
    "setup.vi": b"RSRC\r\n\x00\x03LVINLBVW" + bytes(100),
    "time and torque.txt": b"time and torque of each run\nare in b.csv\n",
    "a header.txt": b"Zeit;Tastgrad;Drehmoment\r\nx;y;z\r\n",
}  # fmt: skip
"""Each named in the warning and left out."""
SILENT = ["notes.md", "picture.png", "script.m", "model.slx", ".DS_Store", "Thumbs.db", "desktop.ini", ".notes.txt.swp"]
DAMAGED: dict[str, bytes] = {
    "a.csv": b"", "c.csv": b"time_s,duty_pct,torque_nm\n0,0,0\n1,0,0\n",
    "d.csv": PROSE.encode(), "e.csv": b"PK\x03\x04 a workbook that was called CSV", "f.mat": bytes(3000),
    "g.csv": bytes(3000), "h.txt": LOG.replace("3.5,", "3.5x,").encode(),
    "j.txt": b"0 0 0\n" * 50, "k.tdms": b"TDSm" + bytes(10),
}  # fmt: skip
"""What looks like a log that came to harm: read, and so refused by its name."""


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "logs"
    made.mkdir()
    (made / "run1.csv").write_text(LOG)
    return made


def test_what_plainly_is_no_log_is_left_out_and_named_in_one_warning(folder, run_eaid):
    for name, content in (BESIDE | dict.fromkeys(SILENT, b"1,2,3\n" * 10)).items():
        (folder / name).write_bytes(content)
    ran = run_eaid("ingest", folder, "-o", folder.parent / "d.h5")
    assert ran.code == 0 and [line for line in ran.err.splitlines() if "left out" in line] == [
        f"warning: {folder}: left out as no logs: README, a header.txt, firmware.bin, liesmich.txt, model.slxc "
        f"and {len(BESIDE) - 5} more; a file given by name is always read"
    ]
    with pytest.raises(DataError) as caught:  # given by name they are refused
        eaid.read([folder / name for name in BESIDE])
    assert all(any(said.startswith(f"{folder / name}: ") for said in caught.value.sentences) for name in BESIDE)


def test_damaged_logs_in_a_folder_are_refused_by_name(folder):
    for name, content in DAMAGED.items():
        (folder / name).write_bytes(content)
    with pytest.raises(DataError) as caught:
        eaid.read(folder, logs_as="steps")
    said = "\n".join(caught.value.sentences)
    assert {name for name in DAMAGED if f"{folder / name}: " in said} == set(DAMAGED) and "run1.csv" not in said


def test_folders_that_hold_no_logs_and_paths_that_are_wrong(tmp_path, run_eaid):
    empty, noted = tmp_path / "empty", tmp_path / "noted"
    for made in (empty, noted):
        made.mkdir()
        (made / "notes.md").write_text(PROSE)
    (noted / "notes.txt").write_text(PROSE)
    ran = run_eaid("ingest", empty, noted, tmp_path / "gone", "-o", tmp_path / "d.h5")
    assert ran.code == 3 and ran.err == (
        f"error: {empty}: holds no logs; give the folder that does\n"
        f"error: {noted}: holds no logs (left out: notes.txt); give the folder that does\n"
        f"error: {tmp_path / 'gone'}: no such file or folder; check the path\n"
    )
    (tmp_path / "a.csv").write_text(LOG)
    with pytest.raises(UsageError, match=f"{tmp_path}/a.csv: is given twice; a log counts once"):
        eaid.read([tmp_path / "a.csv", tmp_path / "empty" / ".." / "a.csv"])
    (tmp_path / "a\x1b\u202e.csv").write_text(LOG)
    with pytest.raises(
        DataError, match=f"{tmp_path}/a .csv: its name, or that of its folder, holds characters that no"
    ):
        eaid.read(tmp_path / "a\x1b\u202e.csv")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="is no plain file; give a log or a folder of logs"):
        eaid.read(tmp_path / "pipe")


def test_what_eaid_made_of_the_logs_does_not_count_again(folder, run_eaid):
    shutil.copy(folder / "run1.csv", folder / "run2.csv")
    for count in (0, 1):
        ran = run_eaid("ingest", folder, "-o", folder / "data.h5", "--force")
        assert ran.code == 0 and ran.err.count("left out as no logs: data.h5") == count
    for name in ("run1.csv", "run2.csv"):
        (folder / name).unlink()
    assert eaid.read(folder).levels[0].level == 50.0  # alone it is what is meant


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are UTF-8 there")
def test_names_that_are_not_utf8(folder, run_eaid):
    odd = os.fsdecode(b"caf\xe9")
    (folder / f"{odd}.csv").write_text(LOG)
    for given in (folder, folder / f"{odd}.csv"):
        ran = run_eaid("ingest", given, "-q", "-o", folder.parent / "d.h5")
        said = f"error: {folder}/caf\\udce9.csv: its name, or that of its folder, is not UTF-8; rename it\n"
        assert (ran.code, ran.err) == (3, said)
    for _ in range(2):
        assert run_eaid("ingest", folder / "run1.csv", "-q", "--force", "-o", folder.parent / f"{odd}.h5").code == 0
    assert [path.name for path in folder.parent.iterdir() if path.is_file()] == [f"{odd}.h5"]


def test_columns_taken_and_left_are_told_before_anything_else(tmp_path, run_eaid):
    for k, more in enumerate(("T1", "T1", "T1", "T2")):
        (tmp_path / f"a{k}.csv").write_text(text(f"time (ms),duty_pct,Torque_mNm,{more}", 1e3 * T, U, Y + k, T))
    (tmp_path / "b.csv").write_text(text("t,voltage,y,torque_ref,x [mm]", T, 2.0 * U, Y, U, Y))
    ran = run_eaid("ingest", tmp_path, "-o", tmp_path / "d.h5")
    like = "columns of {}: time = time (ms) → s, input = duty_pct [%], output = Torque_mNm [N·m]; left: {}"
    assert [line for line in ran.err.splitlines() if line.startswith("columns")] == [
        like.format("3 logs", "T1"), like.format("1 log", "T2"),
        "columns of 1 log: time = t [s], input = voltage [V], output = y [a.u.], reference = torque_ref [?]; "
        "left: x [mm]",
    ]  # fmt: skip
    ran = run_eaid("ingest", tmp_path / "b.csv", "--columns", "position=5", "--force", "-o", tmp_path / "d.h5")
    assert "reference = torque_ref [?], position = x [mm]; left: none\n" in ran.err


@pytest.mark.parametrize(
    ("name", "pattern", "level", "repeat"),
    [
        ("b_V=-12,5_r3.csv", "_V={level}_r{repeat}.", -12.5, 3), ("u-4.5_r10.csv", "u{level}_r{repeat}", -4.5, 10),
        ("a+3.csv", "a{level}", 3, None), ("x.run7.csv", "run{repeat}", None, 7),
        (f"b_{2**63 - 1}.csv", "b_{repeat}", None, 2**63 - 1), ("a.5.csv", "a.{level}", 5, None),
    ],
)  # fmt: skip
def test_names_tell_level_and_repeat(name, pattern, level, repeat, read):
    still = "level" in pattern
    log = frame(f"time_s|{'x' if still else 'duty'}|torque_nm", T, 0 * T if still else U, Y)
    run = read(log, name, name_pattern=pattern, units={"input": "V"})
    assert (run.level, run.repeat, run.has_input, run.input_unit) == (level, repeat, not still, "V")
    assert np.isnan(run.input).all() == still


@pytest.mark.parametrize(
    ("name", "contradicted"),
    [("u40", True), ("u50", False), ("u51", False), ("u49,02", False), ("u48,9", True), ("u52", True), ("u-50", False)],
)
def test_a_level_in_the_name_within_2_percent_of_the_input(name, contradicted, read, codes):
    for sign in (1, -1):
        run = read(frame("time|duty|torque_nm", T, sign * U, Y), name, name_pattern="u{level}")
        assert run.level is None and ("level-contradicted" in codes(run)) is contradicted
        if name == "u40":
            assert codes(run)["level-contradicted"] == {"level": 40.0, "found": sign * 50.0, "unit": "%"}


@pytest.mark.parametrize(
    ("tops", "told"),
    [
        ((0.5, 50.0), {0: 50.0}), ((-0.5, -50.0), {0: 50.0}), ((0.5, 1.5), {}), ((0.5, 1.6), {0: 1.6}),
        ((1.0, 100.0), {0: 100.0}), ((1.0, 99.0), {}), ((1.0, 99.9996), {0: 99.9996}), ((1.1, 100.0), {}),
        ((0.0, 100.0), {}), ((0.5, 1.0), {}), ((0.5, 40.0, 100.0, 1.0), {0: 100.0, 3: 100.0}),
    ],
)  # fmt: skip
def test_fractions_among_percent(tops, told, read, codes):
    logs = {f"r{k}": frame("time|duty|torque_nm", T, top * U / 50, (1 + k) * Y) for k, top in enumerate(tops)}
    found = {k: codes(run) for k, run in enumerate(read.all(logs))}
    assert {k: one["input-in-fractions"]["other"] for k, one in found.items() if one} == pytest.approx(told)
    said = {one.severity for run in read.all(logs) for one in run.findings}
    assert said <= {"stop", "note"} and not any(codes(run) for run in read.all(logs, units={"input": "%"}))


def test_inputs_of_other_units_are_no_fractions(read, codes):
    logs = {"a": frame("time|duty|torque_nm", T, U / 100, Y), "v": frame("time|voltage_V|torque_nm", T, U, 2 * Y)}
    assert not any(codes(run) for run in read.all(logs))
    logs["b"] = frame("time|duty|torque_nm", T, U, 3 * Y)
    assert [len(codes(run)) for run in read.all(logs)] == [1, 0, 0]


@pytest.mark.parametrize(
    ("factors", "told"),
    [((1, 1000), {0, 1}), ((1, 1, 1000), {2}), ((1e6, 1e6, 1), {2}), ((1, 1 / 60, 1), {1}), ((1, 1, 1), set()),
     ((1, 2, 10), set())],
)  # fmt: skip
def test_clocks_of_other_units_among_the_logs(factors, told, read):
    """The unit of a time that nobody says is judged beside the other logs; where it is said, all is well."""
    logs = {f"r{k}": frame("time|duty|torque_nm", by * (T + 0.001 * np.sin(9 * T)), U, (1 + k) * Y)
            for k, by in enumerate(factors)}  # fmt: skip
    asked = read.refused(logs) if told else []
    assert {
        k for k in range(len(factors)) for one in asked if one.startswith(f"r{k}: ") and "different units" in one
    } == told
    read.all(logs, units={"time": "s"})
    named = {name: log.rename(columns={"time": "time_s"}) for name, log in logs.items()}
    read.all(named)


def test_a_log_that_comes_again_counts_once_and_names_are_told_apart(tmp_path, codes, run_eaid):
    for name, content in {"x/a.csv": LOG, "y/a.csv": OTHER, "y/c.csv": LOG, "z/c.txt": LOG}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / "z" / "a.csv.gz").write_bytes(gzip.compress(LOG.encode()))
    given = [tmp_path / name for name in ("x", "y", "z")]
    runs = eaid.read(given, logs_as="recorded").recorded
    assert [run.name for run in runs] == ["x-a", "y-a"]
    copies = {one.values["other"] for one in runs[0].findings if one.code == "run-given-twice"}
    assert copies == {str(tmp_path / name) for name in ("y/c.csv", "z/c.txt", "z/a.csv.gz")} and not runs[1].findings
    assert run_eaid("ingest", tmp_path / "x", "-q", "-o", tmp_path / "d.h5").code == 0
    (rise, fall) = eaid.read([tmp_path / "d.h5", tmp_path / "x" / "a.csv"]).steps
    assert rise.dataset and fall.dataset and "run-given-twice" in [one.code for one in rise.findings]
    shares = {"a": 1, "b": 1, "c": 1.001}
    frames = {name: frame("time_s|duty_pct|torque_nm", T, U, k * Y) for name, k in shares.items()}
    first, other = eaid.read(frames, logs_as="recorded").recorded
    assert (first.name, other.name, list(codes(first))) == ("a", "c", ["run-given-twice"])


NAMES = {"20241103_V={u}_run{k}": "_V={level}_", "run{k}_{u}V": "run{repeat}_{level}V", "u{u}_{k}": "u{level}_"}


@pytest.mark.parametrize("name", [k if k[0] == "2" else pytest.param(k, marks=pytest.mark.slow) for k in NAMES])
def test_what_is_missing_in_a_folder_is_guessed_together_and_the_command_works(name, run_eaid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    for k, u in enumerate((20, 40, 60, 20, 40, 60)):
        y = u * np.where(T < 2, 0.0, np.where(T < 7, -np.expm1(-(T - 2) / 0.5), np.exp(-(T - 7) / 0.1)))
        table = text("stamp,load,bench", 1e6 * T, y, 21 + 0.01 * np.sin(T))
        (tmp_path / "logs" / f"{name.format(u=u, k=k)}.csv").write_text(table + "x,1,1\n" * (k == 5))
    ran = run_eaid("fit", "logs", "-o", "mine.json", "--ci", "none")
    pattern = NAMES[name]
    assert ran.code == 3 and ran.err.splitlines()[-1] == (
        f"try: eaid fit logs --repair --name-pattern '{pattern}' --step-at 2 --until 7 --columns time=stamp "
        f"--units time=us{',input=V' * ('V' in name)} --ci none --output mine.json"
    )
    assert run_eaid(*shlex.split(ran.err.splitlines()[-1].removeprefix("try: eaid "))).code == 0
    made = eaid.load("mine.json")  # with all that was asked for
    assert made.levels == (20.0, 40.0, 60.0) and made.options.ci == "none"


STEP = np.where(T >= 2, 9.0, 0.0)
SPEED = 11 * -np.expm1(-np.maximum(T - 2, 0) / 0.4)
UNNAMED = {  # one log each: its columns, what is said already, and what is then proposed
    "a motor": ("Tiempo (s),Orden,Voltaje (V),Velocidad (rad/s)", (T, 28 * STEP, STEP, SPEED), "",
                "--columns 'input=\"Voltaje (V)\",output=\"Velocidad (rad/s)\"'"),
    "a row index, two sensors": ("n,Time,T1,T2,Q1", (np.arange(len(T)), T, 20 + SPEED, 20 + 0.1 * SPEED, STEP), "",
                                 "--columns input=Q1,output=T1"),
    "two sensors alike": ("Time,T1,T2,Q1", (T, 20 + SPEED, 20 + 0.9 * SPEED, STEP), "", None),
    "a sensor said": ("Time,T1,T2,Q1", (T, 20 + SPEED, 20 + 0.9 * SPEED, STEP), "--columns output=T1",
                      "--columns output=T1,input=Q1"),
    "stamps of a serial monitor": (
        None, ([f"12:00:{t:06.3f} -> {1e3 * t:.0f}" for t in T], STEP, 20 + SPEED), "",
        "--columns time=1,input=3,output=4"),
    "no names, a row index": (None, (np.arange(len(T)), T, STEP, SPEED), "", "--columns time=2,input=3,output=4"),
    "no names, no time": (None, (STEP, 20 + SPEED), "", None),  # nobody else knows the rate
    "a second time that steps": ("Time,Lap (s),Speed,Heat", (T, STEP, SPEED, 0.4 * SPEED), "", None),
    "a reference, no input": ("Time,Commanded Pos,Control Effort", (T, SPEED, SPEED), "", None),
}  # fmt: skip


@pytest.mark.parametrize("name", UNNAMED)
def test_columns_without_a_name_that_says_it_are_proposed(name, run_eaid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    header, columns, said, proposed = UNNAMED[name]
    (tmp_path / "log.csv").write_text(text(header or "", *columns).lstrip("\n"))
    ran = run_eaid("fit", "log.csv", *shlex.split(said), "-o", "mine.json")
    tries = [line.removeprefix("try: eaid fit log.csv ") for line in ran.err.splitlines() if line.startswith("try: ")]
    assert ran.code == 3 and tries == [f"{proposed} --output mine.json"] * (proposed is not None)
    if proposed is not None:
        assert run_eaid("ingest", "log.csv", *shlex.split(proposed), "-o", "data.h5").code == 0
        assert [one.level for one in eaid.read("data.h5").levels] == [9.0]


def test_what_was_tried_is_not_proposed_again(run_eaid, tmp_path, monkeypatch):
    """More rows are bad than «repair» drops, and the unit that would be guessed is given."""
    monkeypatch.chdir(tmp_path)
    bad = np.where((T > 3) & (T < 4), np.nan, SPEED)
    (tmp_path / "log.csv").write_text(text("Time,PWM,Speed", T, 255 * (STEP > 0), bad).lstrip("\n"))
    ran = run_eaid("fit", "log.csv", "--columns", "input=PWM,output=Speed", "--units", "input=/255", "--repair")
    assert ran.code == 3 and "record it again" in ran.err and "try:" not in ran.err


def test_columns_of_an_array_file_are_proposed_as_those_of_a_text(run_eaid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("log.npy", np.stack([T, STEP, SPEED], axis=1))
    ran = run_eaid("ingest", "log.npy")
    proposed = "ingest log.npy --columns time=1,input=2,output=3"
    assert (
        ran.code == 3 and ran.err.splitlines()[-1] == f"try: eaid {proposed}" and run_eaid(*proposed.split()).code == 0
    )


def test_what_one_reading_option_mends_is_asked_before_any_fit(run_eaid, tmp_path, monkeypatch):
    """Rows far out, a duty that may be a fraction; a fit is not begun, and is made where the option is given."""
    monkeypatch.chdir(tmp_path)
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(T))
    (tmp_path / "log.csv").write_text(
        text("time_s,duty_cycle,force_n", T, STEP / 10, np.where(np.arange(len(T)) == 300, 90.0, SPEED + noise))
    )
    monkeypatch.setattr("eaid.levels.workflow.fit_steps", lambda *_: pytest.fail("was fitted"))
    ran = run_eaid("fit", "log.csv")
    assert ran.code == 3 and all(word in ran.err for word in ("--repair drops", "--units input=fraction", "input=%"))
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    ran = run_eaid("fit", "log.csv", "--repair", "--units", "input=fraction")
    assert ran.code == 0 and "fraction of 1" not in ran.err and "held   at 90 %" in ran.out


def bench(folder, levels=(40, 60, 80), until_s=7.0):
    """Logs without an input: a relay that the drive switches to and fro from 2 s on, a stage that starts with it."""
    rng = np.random.default_rng(5)
    folder.mkdir(exist_ok=True)
    for u in levels:
        held = -np.expm1(-np.maximum(T - 2, 0) / 0.3)
        y = u * np.where(until_s > T, held, 0.0) + rng.normal(0, 0.3, len(T))
        on = (T >= 1.9) & (until_s > T)
        relay = np.where(on & (np.arange(len(T)) % 4 < 2), 300.0, 0.0) + rng.normal(0, 0.5, len(T))
        log = text("Time,Load Cell,Moving Forward,Relay Output", 1e6 * T, y, 1.0 * on, relay)
        (folder / f"2024_V={u}_f=1000_w=2.csv").write_text(log)


def test_the_first_try_of_a_bench_names_each_cause_once_and_what_it_proposes_works(run_eaid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bench(tmp_path / "logs")
    for command in ("ingest", "fit"):
        ran = run_eaid(command, "logs", "-o", "out")
        causes = [line.split(": ", 2)[-1] for line in ran.err.splitlines() if line.startswith("error: ")]
        assert ran.code == 3 and len(causes) == 1
        assert causes[0].startswith(
            "Time rises by 1e+04 a row, 9.99e+06 in all: µs, 9.99 s in all? say --units time=us, "
        )
        proposed = ran.err.splitlines()[-1]
        assert proposed == (
            f"try: eaid {command} logs --name-pattern '_V={{level}}_' --step-at 2 --until 7 --units time=us,input=V"
            " --output out"
        )
    words = shlex.split(proposed.removeprefix("try: eaid "))
    ran = run_eaid(*words, "-o", "fit.json", "--ci", "none", "-v")
    assert ran.code == 0 and "Moving Forward moves with the step" not in ran.err  # it moves 0.1 s before 2 s
    at = words.index("--until")
    ran = run_eaid(*words[:at], *words[at + 2 :], "-o", "fit.json", "--force")
    assert ran.code == 3 and "the output falls at 7 s in 3 of 3 logs and stays low: a release" in ran.err
    at = words.index("--step-at")
    ran = run_eaid(*words[:at], *words[at + 2 :], "-o", "fit.json", "--ci", "none", "-v", "--force")
    assert ran.code == 0 and "Moving Forward moves with the step" in ran.err
    assert "taken from Relay Output, which is switched on there (and 2 more)" in ran.err
    (one,) = sorted((tmp_path / "logs").iterdir())[:1]
    ran = run_eaid("fit", one, "--columns", "input=Relay Output", "--units", "time=us", "-o", "one.json")
    assert ran.code == 3 and "the input goes to and fro every 2 rows" in ran.err


@pytest.mark.slow
def test_factors_of_names_are_told_and_choose(tmp_path, run_eaid):
    time = np.arange(0, 8, 0.02)
    for level, hz in itertools.product((100, 200), (500, 1000)):
        force = np.where(time < 2, 0, level * hz / 1e5 * (1 - np.exp(-(time - 2) / 0.5)))
        rows = "".join(f"{t:.2f},{y:.5f}\n" for t, y in zip(time, force, strict=True))
        (tmp_path / f"rep=1_V={level}_f={hz}_glue=old.csv").write_text("time_s,force_n\n" + rows)
    words = ("--name-pattern", "V={level}", "--units", "input=V", "--step-at", "2")
    ran = run_eaid("ingest", tmp_path, *words, "-o", tmp_path / "all.h5")
    two = tmp_path / "rep=1_V=200_f=1000_glue=old.csv"
    two.rename(two.with_name(two.name.replace("f=1000", "f=1000.0")))  # the same number
    told = "the names of the logs differ in f too, 1000, 500: all are taken together; choose with --where f=1000"
    assert told in ran.out and "in glue" not in ran.out and "in rep" not in ran.out
    for source in (tmp_path / "all.h5", tmp_path):
        more = words if source.is_dir() else ()
        ran = run_eaid(
            "fit", source, *more, "--where", "f=500", "--where", "glue=old", "-o", tmp_path / "f.json", "--force"
        )
        many = eaid.read(source, where={"f": "1e3"}, **({"name_pattern": "V={level}", "step_at": 2.0} if more else {}))
        assert [run.level for run in many.runs] == [100.0, 200.0]
        fit = eaid.load(tmp_path / "f.json")
        assert ran.code == 0 and [one.Ts for one in fit.friction.levels] == pytest.approx([0.5, 1.0], rel=0.02)
        assert fit.options.reading["where"] == "f=500,glue=old"
    (tmp_path / "all.h5").unlink()
    ran = run_eaid("ingest", tmp_path, *words, "--where", "f=50")
    assert (ran.code, ran.err.splitlines()[-1]) == (
        2, "error: --where f=50: no name says so; they say V=100, V=200, f=1000, f=500, glue=old, rep=1"
    )  # fmt: skip


def test_counts_up_to_255_are_proposed_with_all_else_that_is_missing(tmp_path, run_eaid, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for level in (85, 170, 255):
        force = level * np.where(T < 1, 0, 1 - np.exp(1 - T))
        table = text("t,pwm,force", np.round(1e3 * T), np.where(T < 1, 0, level), force)
        (tmp_path / f"d{level}.csv").write_text(table)
    asked = run_eaid("ingest", ".", "-o", "data.h5")
    (proposed,) = [line for line in asked.err.splitlines() if line.startswith("try: eaid ")]
    assert "--units time=ms,input=/255" in proposed
    assert run_eaid(*shlex.split(proposed.removeprefix("try: eaid "))).code == 0
    assert [one.level for one in eaid.read("data.h5").levels] == pytest.approx([100 / 3, 200 / 3, 100])


@pytest.mark.parametrize(("column", "warned"), [("voltage", False), ("velocity", True)])
def test_a_switch_beside_levels_in_names_is_no_input(column, warned, tmp_path, run_eaid):
    on = (T >= 1) & (T < 2.5)
    for volts in (100, 150, 200):
        force = volts / 50 * np.where(T < 2.5, -np.expm1(-np.maximum(T - 1, 0) / 0.1), np.exp(-(T - 2.5) / 0.02))
        (tmp_path / f"a_V={volts}.csv").write_text(text(f"time_s,{column},force_n", T, 5.0 * on, force))
    asked = run_eaid("ingest", tmp_path, "-o", tmp_path / "one.h5")
    assert "or take it for the level with --name-pattern 'V={level}'" in asked.out
    words = ("--name-pattern", "V={level}", "--units", "input=V")
    ran = run_eaid("ingest", tmp_path, *words, "-o", tmp_path / "three.h5")
    assert f"left: {column}" in ran.err and ("moves with the step" in ran.out) is warned
    steps = eaid.read(tmp_path / "three.h5")
    assert [one.level for one in steps.levels] == [100.0, 150.0, 200.0] and len(steps.releases) == 3
    assert {round(run.step_s, 2) for run in steps.runs} == {1.0, 2.5}
    kept = eaid.read(tmp_path, columns={"input": column}, name_pattern="V={level}")  # the user's own choice
    assert [one.level for one in kept.levels] == [5.0]


def test_an_instant_that_is_proposed_is_written_in_full():
    t = np.arange(0.0, 40.0, 0.02)
    log = frame("time_s|torque_nm", t, ((t >= 5) & (t < 30)) + 1e-3 * np.sin(1e3 * t))
    with pytest.raises(DataError, match="the output falls at 30 s and stays low"):
        eaid.fit(log)


def test_runs_of_a_long_table_are_those_of_files_of_their_own(tmp_path):
    """Told apart by the column that changes where the time falls; not by one that changes elsewhere, too."""
    each = [np.round(size * Y[::10], 6) for size in (1.0, 1.02, 0.97)]
    names = "time_s,duty_pct,torque_nm"
    for k, y in enumerate(each):
        (tmp_path / f"{k}.csv").write_text(text(names, T[::10], U[::10], y))
    t, u, y, n = np.tile(T[::10], 3), np.tile(U[::10], 3), np.concatenate(each), len(T[::10])
    of_runs, hall_c = np.repeat([7.0, 8.0, 9.0], n), np.round(20 + 0.001 * np.arange(3 * n), 2)
    path = tmp_path / "long.csv"
    path.write_text(text(f"{names},temperature,run", t, u, y, hall_c, of_runs))
    long, apart = eaid.read([path]), eaid.read([tmp_path / f"{k}.csv" for k in range(3)])
    assert [run.name for run in long.runs if run.edge == "rising"] == ["long-run7", "long-run8", "long-run9"]
    assert [one.mean.tolist() for one in long.levels] == [one.mean.tolist() for one in apart.levels]
    assert len({run.sha256 for run in long.runs}) == 3
    path.write_text(text(f"{names},temperature,run", t, u, np.where(t == 3, np.nan, y), hall_c, of_runs))
    with pytest.raises(DataError, match=f"(?s)row 32, column torque_nm.*row {n + 32}, column torque_nm"):
        eaid.read([path])
    path.write_text(text(f"{names},temperature", t, u, y, hall_c))
    with pytest.raises(DataError, match="time falls at row 102 .* number its runs in a further column"):
        eaid.read([path])


def test_levels_may_be_told_by_the_folders_of_the_logs(tmp_path, run_eaid):
    for level in (20, 60):
        (tmp_path / f"{level}pct").mkdir()
        for k in range(2):
            y = np.round((1 + 0.01 * k) * level / 60 * Y[::10], 6)
            (tmp_path / f"{level}pct" / f"run{k}.csv").write_text(text("time_s,torque_nm", T[::10], y))
    ran = run_eaid("ingest", tmp_path, "-o", tmp_path / "d.h5")
    assert ran.code == 3 and f"by itself, but 20pct, 60pct do; give those within: {tmp_path}/*" in ran.err
    ran = run_eaid("ingest", tmp_path / "20pct", tmp_path / "60pct", "-o", tmp_path / "d.h5")
    proposed = shlex.split(ran.err[ran.err.index("try: eaid ") :].splitlines()[0].removeprefix("try: eaid "))
    assert ran.code == 3 and "{level}pct-" in proposed and run_eaid(*proposed).code == 0
    assert [level.level for level in eaid.read([tmp_path / "d.h5"]).levels] == [20.0, 60.0]


def test_an_alternating_voltage_holds_the_level_that_the_name_tells(tmp_path):
    """±V at 5 Hz: it was fitted as recorded, of both signs, with one lag; a motor that turns once is none."""
    for volts in (100, 200):
        sign = np.where(np.arange(len(T)) % 20 < 10, 1.0, -1.0)
        (tmp_path / f"V={volts}.csv").write_text(
            text("time_s,voltage_V,torque_nm", T, volts * sign * (U > 0), np.round(Y * volts / 200, 6))
        )
    steps = eaid.read(tmp_path, name_pattern="V={level}")
    assert [one.level for one in steps.levels] == [100.0, 200.0] and not steps.recorded
    assert [one.code for run in steps.runs for one in run.findings].count("input-alternates") >= 2
    both = text("time_s,voltage_V,torque_nm", T, 100.0 * sign * (U > 0), Y)  # the size that the output goes with
    (tmp_path / "x.csv").write_text(both)
    assert [one.level for one in eaid.read([tmp_path / "x.csv"]).levels] == [100.0]
    turned = text("time_s,voltage_V,torque_nm", T, np.where(T < 4.5, 100.0, -100.0) * (U > 0), Y)
    (tmp_path / "V=100.csv").write_text(turned)
    assert "input-alternates" not in str(eaid.read([tmp_path / "V=100.csv"], name_pattern="V={level}").all_findings)


def test_the_column_that_drives_by_its_unit_is_proposed_before_levels_of_the_names(run_eaid, tmp_path, monkeypatch):
    """Of 80 to 400 V the numbers of the names were fitted, 20 to 100, in no unit."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    t = np.arange(1200) / 50
    for level, k in itertools.product((20, 60, 100), range(2)):
        y = np.where(t >= 5, -level / 20 * np.expm1(-(t - 5) / 0.5), 0.0) + 1e-3 * np.sin(1e4 * t + k)
        table = pd.DataFrame({"Time (s)": t, "HV (V)": np.where(t >= 5, 4.0 * level, 0.0), "Force (N)": y})
        table.to_csv(tmp_path / "logs" / f"u{level}_{k}.csv", index=False)
    (proposed,) = [line for line in run_eaid("fit", "logs").err.splitlines() if line.startswith("try: ")]
    assert 'input="HV (V)"' in proposed and "name-pattern" not in proposed
    assert run_eaid(*shlex.split(proposed.removeprefix("try: eaid "))).code == 0
    assert eaid.load("fit.json").data.levels == (80.0, 240.0, 400.0)


@pytest.mark.parametrize(("column", "warned"), [("HV Monitor [V]", False), ("stage speed [mm/s]", True)])
def test_a_monitor_of_the_voltage_does_not_load_the_output(column, warned, tmp_path):
    log = text(f"time_s,{column},force_n", T, 0.3 * (T >= 1), 2 * np.where(T < 1, 0, 1 - np.exp(1 - T)))
    (tmp_path / "a_300V.csv").write_text(log)
    run = eaid.read(tmp_path, name_pattern="{level}V", step_at=1.0).runs[0]
    assert ("moves-with-step" in {one.code for one in run.findings}) is warned


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["16_18_17_V=250", "16_19_01_V=250"], "_V={level}"), (["V=250_r1", "V=250_r2"], "V={level}_"),
        (["5V_u20", "5V_u40"], "_u{level}"), (["u250_run1", "u250_run2"], ""), (["a_5", "a_6"], ""),
    ],
)  # fmt: skip
def test_a_level_that_all_names_share_is_proposed_beside_a_unit_and_the_number_of_a_run_never(names, pattern):
    assert pattern_guessed(names) == pattern
