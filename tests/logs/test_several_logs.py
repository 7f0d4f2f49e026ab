"""Logs of one call: what a folder holds, what their names and dataset.toml say, copies, fractions, parts of one run."""

import gzip
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs_written import frame, text

import eaid
from eaid import DataError, UsageError

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
}  # fmt: skip
"""Each named in the warning and left out."""
SILENT = ["notes.md", "picture.png", "script.m", "model.slx", ".DS_Store", "Thumbs.db", "desktop.ini", ".notes.txt.swp"]
DAMAGED: dict[str, bytes] = {
    "a.csv": b"", "b.txt": b"time_s\tduty_pct\ttorque_nm\n", "c.csv": b"time_s,duty_pct,torque_nm\n0,0,0\n1,0,0\n",
    "d.csv": PROSE.encode(), "e.csv": b"PK\x03\x04 a workbook that was called CSV", "f.mat": bytes(3000),
    "g.csv": bytes(3000), "h.txt": LOG.replace("3.5,", "3.5x,").encode(),
    "i.txt": b"Zeit;Tastgrad;Drehmoment\r\nx;y;z\r\n", "j.txt": b"0 0 0\n" * 50, "k.tdms": b"TDSm" + bytes(10),
    "l.txt": b"Wert;Zeit;M\nx;y;z\nDrehmoment;t\n",
    "m.txt": b"\n".join(b"# %d" % k for k in range(99)) + b"\ntime,torque\n",
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
        f"warning: {folder}: left out as no logs: README, firmware.bin, liesmich.txt, model.slxc, notes.txt "
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
    like = "columns of {}: time = time (ms) [s], input = duty_pct [%], output = Torque_mNm [N·m]; left: {}"
    assert [line for line in ran.err.splitlines() if line.startswith("columns")] == [
        like.format("3 logs", "T1"), like.format("1 log", "T2"),
        "columns of 1 log: time = t [s], input = voltage [V], output = y [?], reference = torque_ref [?]; left: x [mm]",
    ]  # fmt: skip
    ran = run_eaid("ingest", tmp_path / "b.csv", "--columns", "position=5", "--force", "-o", tmp_path / "d.h5")
    assert "reference = torque_ref [?], position = x [mm] [mm]; left: none\n" in ran.err


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


def test_a_trigger_and_a_level_in_the_name(read, codes):
    on = (U > 0).astype(float)
    said = {"name_pattern": "u{level}_r{repeat}", "units": {"input": "V"}}
    run = read(frame("time|enable|torque_nm", T, 2 + 3 * on, Y), "u40_r2", **said)
    assert (run.level, run.repeat, run.input_unit, run.kind, run.left) == (None, 2, "V", None, ())
    assert run.input.tolist() == (40 * on).tolist() and dict(run.taken)["input"] == "enable"
    assert codes(run) == {"level-times-trigger": {"column": "enable", "level": 40.0}}
    for other in (np.floor(T / 3), np.arange(1000) % 2, 0 * T):  # four values, no steps, still
        run = read(frame("time|enable|torque_nm", T, other, Y), "u40", name_pattern="u{level}")
        assert (run.level, run.left, run.has_input) == (40.0, ("enable",), False)


SWITCHED = {
    f"t_{10 * k}V_{n}": frame("time|enable|torque_nm", T, U > 0, k * Y + n / 1e3) for k in (1, 2) for n in (1, 2)
}


def test_logs_that_say_only_on_or_off_are_no_repeats_where_their_names_differ(read):
    (said,) = read.refused(SWITCHED)
    assert said == (
        't_10V_1 and 3 more: enable says only on or off, and the names of the logs differ in a number; say that it is '
        'the level with «name_pattern» "t_{level}V_", or that 1 is the level of all with «columns» input="enable"'
    )  # fmt: skip
    assert [one.level for one in eaid.read(SWITCHED, name_pattern="t_{level}V_").levels] == [10.0, 20.0]
    assert [one.level for one in eaid.read(SWITCHED, input="enable").levels] == [1.0]


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
def test_clocks_of_other_units_among_the_logs(factors, told, read, codes):
    """The unit of a time that nobody says is judged beside the other logs; where it is said, all is well."""
    logs = {f"r{k}": frame("time|duty|torque_nm", by * (T + 0.001 * np.sin(9 * T)), U, (1 + k) * Y)
            for k, by in enumerate(factors)}  # fmt: skip
    assert {k for k, run in enumerate(read.all(logs)) if "time-unit-differs" in codes(run)} == told
    assert not any("time-unit-differs" in codes(run) for run in read.all(logs, units={"time": "s"}))
    named = {name: log.rename(columns={"time": "time_s"}) for name, log in logs.items()}
    assert not any("time-unit-differs" in codes(run) for run in read.all(named))


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
    frames = {name: frame("time_s|duty_pct|torque_nm", T, U, Y + k) for name, k in (("a", 0), ("b", 0), ("c", 1e-3))}
    first, other = eaid.read(frames, logs_as="recorded").recorded
    assert (first.name, other.name, list(codes(first))) == ("a", "c", ["run-given-twice"])


def part(start_s: float, rows: slice = slice(None), **more: Any) -> Any:
    columns = {"time_s": T[rows] + start_s, "duty_pct": U[rows], "torque_nm": Y[rows]} | more
    return frame("|".join(columns), *columns.values())


@pytest.mark.parametrize(
    ("name", "whole"),
    [("log_part01", "log"), ("log-1", "log"), ("log.part.1", "log"), ("log 001", "log"), ("log_2", "log_2"), ("1", "1"),
     ("log11", "log11"), ("u=101", "u=101"), ("part1", "part1"), ("logpart1", "log")],
)  # fmt: skip
def test_parts_of_one_run_are_joined_by_time(name, whole, read):
    parts = {"b": part(14, slice(400, 1000)), name: part(14, slice(0, 150)), "c": part(14, slice(150, 400))}
    run = read(parts, join=True)
    assert (run.name, run.start_s) == (whole, 14.0)
    np.testing.assert_allclose((run.time_s, run.input, run.output), (T, U, Y), atol=1e-12)
    (joined,) = run.findings
    assert joined.code == "logs-joined" and re.fullmatch(r"c \(\w{12}\), b \(\w{12}\)", joined.values["others"])


def test_parts_that_cannot_be_joined(read, codes):
    other = {unit: part(20).rename(columns={column: f"force_{unit}" if unit == "N" else f"voltage_{unit}"})
             for unit, column in (("V", "duty_pct"), ("N", "torque_nm"))}  # fmt: skip
    for first, second, said in (
        (
            part(0),
            part(9.99),
            "begins at 9.99 s, before a ends (9.99 s); logs of one run must follow each other in time",
        ),
        (
            part(4),
            part(4, duty_pct=2 * U),
            "begins at 4 s, before a ends (13.99 s); each begins its clock anew; logs of",
        ),
        (part(0), other["V"], "its input unit is not that of a; join like logs"),
        (part(0), other["N"], "its output unit is not that of a; join like logs"),
    ):
        assert read.refused({"a": first, "b": second}, join=True)[0].startswith(f"b: {said}")
    levels = read.all({"u40_r1": part(0), "u40_r2": part(20, torque_nm=2 * Y)}, name_pattern="_r{repeat}", join=True)
    assert [run.repeat for run in levels] == [1, 2]
    both = read({"a": part(0, torque_ref=U), "b": part(10, torque_ref=Y)}, join=True)
    assert both.reference_nm.tolist() == [*U, *Y]
    one = read({"a": part(0, torque_ref=U), "b": part(10, duty_pct=3 * U)}, join=True)
    assert one.reference_nm is None and one.position is None and len(one.time_s) == 2000
    since = {name: part(0).assign(time_s=(1.7e9 + k + T) * 1e3) for name, k in (("a", 0), ("b", 20))}
    run = read(since, join=True, columns={"time": "1"}, units={"time": "ms"})
    assert list(codes(run)) == ["logs-joined"]  # what is told of both parts stands once
    bad = {"a": part(0), "b": part(9.0), "c": part(30).drop(columns="torque_nm")}
    assert len(read.refused(bad, join=True)) == 1  # logs with faults are not refused again


ODD = {"--columns": "time=Zeit,output=Kraft", "--units": "output=N,input=V", "--name-pattern": "_V={level}_n{repeat}",
       "--step-at": "2", "--until": "7", "--apparatus": "surfaces=1"}  # fmt: skip
SAYS = [word for pair in ODD.items() for word in pair]
MANIFEST = 'schema = "eaid/manifest/1"\n'


def odd_log(path: Path, level: float, more: float = 0.0) -> Path:
    noise = 0.005 * np.random.default_rng(int(level)).normal(size=1000)
    path.write_text(text("Zeit,Kraft", T, np.round(0.02 * level * (Y - 0.1) + 0.1 + noise + more, 6)))
    return path


@pytest.fixture
def odd_logs(tmp_path):
    made = tmp_path / "logs"
    made.mkdir()
    for level in (100, 200):
        for repeat in (1, 2):
            odd_log(made / f"x_V={level}_n{repeat}.csv", level, repeat / 1000)
    return made


def test_the_next_call_needs_no_options(odd_logs, tmp_path, run_eaid):
    out = tmp_path / "a.h5"
    ran = run_eaid("ingest", odd_logs, *SAYS, "--write-manifest", "-o", out)
    assert f"{odd_logs / 'dataset.toml'}: written; eaid ingest {odd_logs} needs no options now" in ran.err
    for given in (odd_logs, odd_logs / "dataset.toml"):
        assert run_eaid("ingest", given, "-q", "--force", "-o", tmp_path / "b.h5").code == 0
        assert (tmp_path / "b.h5").read_bytes() == out.read_bytes()
    written = (odd_logs / "dataset.toml").read_text()
    assert [written.count(f"level = {level}.0") for level in (100, 200)] == [2, 2] and "step_s" not in written
    steps = eaid.read(odd_logs)
    assert [one.level for one in (*steps.levels, *steps.releases)] == [100.0, 200.0] * 2
    assert (steps.input_unit, steps.output_unit, steps.apparatus.surfaces) == ("V", "N", 1)
    # options that are typed win; what came later, or was changed since, is told
    odd_log(odd_logs / "later_V=400_n1.csv", 400)
    odd_log(odd_logs / "x_V=100_n1.csv", 100, 0.01)
    ran = run_eaid("ingest", odd_logs, "--levels", "100", "--force", "-o", out)
    assert f"{odd_logs / 'dataset.toml'}: does not list later_V=400_n1.csv, which is left out" in ran.err
    changed = {run.name for run in eaid.read(out).runs if "log-changed" in [one.code for one in run.findings]}
    assert changed == {"x_V=100_n1"}
    # nothing is overwritten, and a manifest comes alone
    ran = run_eaid("ingest", odd_logs / "x_V=100_n1.csv", *SAYS, "-q", "--write-manifest", "-o", tmp_path / "c.h5")
    assert ran.code == 2 and "dataset.toml: exists already; give --force to overwrite it" in ran.err
    ran = run_eaid("ingest", odd_logs, odd_log(tmp_path / "a.csv", 10), "-o", tmp_path / "c.h5")
    assert ran.code == 2 and "says all about its own logs; give it, or its folder, alone" in ran.err
    there = odd_log(tmp_path / "x_V=10_n1.csv", 10)
    ran = run_eaid(
        "ingest", there, odd_logs / "x_V=100_n2.csv", *SAYS, "-q", "--write-manifest", "-o", tmp_path / "c.h5"
    )
    assert ran.err == "error: --write-manifest: the logs lie in several folders; put them into one\n"
    assert ran.code == 2 and not (tmp_path / "c.h5").exists()


def test_levels_steps_and_repeats_of_single_logs(tmp_path):
    for name, level in (("a", 150), ("b", 250)):
        odd_log(tmp_path / f"{name}.csv", level)
    (tmp_path / "dataset.toml").write_bytes(
        b"\xef\xbb\xbf" + (MANIFEST + '[options]\nunits = "input=V,output=N"\ncolumns = "time=1,output=2"\n'
                           '[[log]]\nfile = "a.csv"\nlevel = 150\nstep_s = 2.0\nuntil_s = 7.0\n'
                           '[[log]]\nfile = "b.csv"\nlevel = 250.0\nrepeat = 3\n').encode()
    )  # fmt: skip
    steps = eaid.read(tmp_path)
    assert [run.level for run in steps.runs] == [150.0, 150.0, 250.0]
    found = {run.name: (run.step_s, run.repeat) for run in steps.runs}
    assert (found["a"], found["a-release"]) == ((2.0, 1), (7.0, 1))
    assert (found["b"][0], found["b"][1]) == (pytest.approx(2.0, abs=0.05), 3)  # the instant told by the output


BAD = {
    "x = [": "is no TOML (", 'schema = "other"': "its schema is 'other', and this eaid reads 'eaid/manifest/1'; write",
    "[options]": "lists no logs; write it again with --write-manifest of eaid ingest",
    '[options]\nfoo = 1\n[[log]]\nfile = "a.csv"': "Object contains unknown field `foo` - at `options`; mend it",
    '[options]\nrest = "x"\n[[log]]\nfile = "a.csv"': "Expected `float | null`, got `str` - at `options.rest`",
    '[options]\nrepair = 1\n[[log]]\nfile = "a.csv"': "Expected `bool | null`, got `int` - at `options.repair`",
    "[[log]]\nlevel = 3": "Object missing required field `file` - at `log[0]`",
    '[[log]]\nfile = "a.csv"\nfoo = 1': "Object contains unknown field `foo` - at `log[0]`",
    '[[log]]\nfile = "a.csv"\nlevel = "3"': "Expected `float | null`, got `str` - at `log[0].level`",
    '[[log]]\nfile = "a.csv"\nlevel = nan': "Expected `float` >= -1000000000000.0 - at `log[0].level`; mend it",
    '[[log]]\nfile = "a.csv"\nrepeat = -1': "Expected `int` >= 0 - at `log[0].repeat`; mend it",
    "x = " + 1000 * "[" + 1000 * "]": "is nested too deep", "x = " + 1000 * "[\n" + 1000 * "]\n": "is nested too deep",
    20_000 * "a." + "a = 1": "has a line of more than 4,000 characters", f"x = '{3994 * 'a'}'": "lists no logs",
    f"x = {5000 * '9'}": "has a line of more than 4,000",
    '[options]\nrest = nan\n[[log]]\nfile = "a.csv"': "--rest nan: give a number from -1e+09 to 1e+09",
    '[options]\nrate_hz = nan\n[[log]]\nfile = "a.csv"': "--rate-hz nan: give a number above 0, 1e+09 at most",
    '[[log]]\nfile = "../a.csv"': "its log ../a.csv lies outside its folder; put it there, or give its whole path",
    '[[log]]\nfile = "gone.csv"': "its log gone.csv is not there; put it back or take it off",
}  # fmt: skip


@pytest.mark.parametrize("content", BAD, ids=[said[:30] for said in BAD.values()])
def test_bad_manifests(content, tmp_path, run_eaid):
    path, sentence = tmp_path / "dataset.toml", BAD[content]
    odd_log(tmp_path / "a.csv", 100)
    path.write_text(content if content.startswith(("x = [", "schema")) else MANIFEST + content)
    ran = run_eaid("ingest", tmp_path, "-q", "-o", tmp_path / "d.h5")
    of_option = sentence.startswith("--")
    assert ran.code == (2 if of_option else 3) and len(ran.err.splitlines()) == 1
    assert ran.err.startswith(f"error: {sentence}" if of_option else f"error: {path}: {sentence}")


def test_reading_options_are_kept_for_doing_it_again(read, tmp_path):
    options = {"columns": "time=Zeit,output=Moment", "units": "time=ms,output=Nm,input=%", "name_pattern": "_u{level}_",
               "step_at": 2.0}  # fmt: skip
    (tmp_path / "log_u60_.csv").write_text(text("Zeit,x,Moment", 1e3 * T, 0 * T, Y))
    steps = eaid.read(tmp_path / "log_u60_.csv", **options)
    again = eaid.read(tmp_path / "log_u60_.csv", **steps.reading)
    assert set(steps.reading) == set(options) and again.reading == steps.reading
    assert ([one.level for one in again.levels], again.steps[0].step_s) == ([60.0], 2.0)
