"""No command replaces what it reads, whatever name leads to it, and nothing but regular files is ever replaced."""

import os
import shlex
import shutil
from pathlib import Path

import pytest

from eaid.cli import main

READS = """
logs/log.csv: ingest logs/log.csv -o OUT
logs/log.csv: ingest logs -o OUT
logs/log.csv: ingest dataset.toml -o OUT
logs/log.csv: fit logs -o OUT
data.h5: fit data.h5 -o OUT
sets/data.h5: fit sets -o OUT
data.h5: tune-rc fit.json --phi data --data data.h5 -o OUT
logs/log.csv: tune-rc fit.json --phi data --data logs -o OUT
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
plan.csv: synth --plan plan.csv -o OUT.h5
report.html: report report.html -o .
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One file of every kind that a command reads."""
    where = tmp_path_factory.mktemp("outputs")
    words = "synth --levels 20,40,60,80,100 --repeats 2 --rate-hz 20 --hold 8 --idle 1 --release 1 -q -o"
    made = words.split()
    assert main.run([*made, str(where / "data.h5")]) == 0
    assert main.run([*made, str(where / "logs")]) == 0
    assert main.run(["fit", str(where / "data.h5"), "-o", str(where / "fit.json"), "--ci", "none", "-q"]) in (0, 4)
    assert main.run(["tune-rc", str(where / "fit.json"), "-o", str(where / "gains.json"), "-q"]) in (0, 5)
    log = min((where / "logs").iterdir())
    log.rename(where / "logs" / "log.csv")
    (where / "dataset.toml").write_text('schema = "eaid/manifest/1"\n[[log]]\nfile = "logs/log.csv"\n')
    (where / "sets").mkdir()
    shutil.copy(where / "data.h5", where / "sets" / "data.h5")
    shutil.copy(where / "fit.json", where / "report.html")
    (where / "reference.csv").write_text("time_s,reference_nm\n0,0\n1,1\n5,1\n")
    (where / "duty.csv").write_text("time_s,duty_pct\n0,0\n1,50\n9,0\n")
    (where / "plan.csv").write_text("order,level,repeat,idle_s,hold_s,release_s\n1,60,1,1,5,1\n")
    return where


def held(folder: Path) -> dict[str, bytes]:
    """Every regular file of a folder."""
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("way", ["itself", "symlink", "hard link"])
@pytest.mark.parametrize("line", READS.strip().splitlines())
def test_a_command_never_replaces_what_it_reads(
    line: str, way: str, rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    where = tmp_path / "rig"
    shutil.copytree(rig, where)
    monkeypatch.chdir(where)
    read, words = line.split(": ")
    out = read
    if "OUT.h5" in words:  # a command that tells its output's kind by its name
        out = f"{read}.h5"
        shutil.move(read, out)
        words, read = words.replace(read, out).replace("OUT.h5", "OUT"), out
    if way != "itself" and "OUT" in words:
        out = "other" + Path(read).suffix
        (os.symlink if way == "symlink" else os.link)(read, out)
    before = held(where)
    assert main.run([*shlex.split(words.replace("OUT", out)), "--force", "-q"]) == 2
    assert "which the command reads" in (told := capsys.readouterr().err) or "is what the command reads" in told
    assert held(where) == before


@pytest.mark.parametrize(
    "line",
    [
        "synth --duty-file out/synthetic-duty.csv -o out",
        "export out/parameters.json --anyway -o out",
        "export gains.json out/parameters.json --anyway -o out",
    ],
)
def test_a_folder_that_holds_what_is_read_is_not_replaced(
    line: str, rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    where = tmp_path / "rig"
    shutil.copytree(rig, where)
    monkeypatch.chdir(where)
    (where / "out").mkdir()
    shutil.copy("duty.csv", "out/synthetic-duty.csv") if "duty" in line else shutil.copy(
        "fit.json" if "gains" in line else "gains.json", "out/parameters.json"
    )
    before = held(where)
    assert main.run([*line.split(), "--force", "-q"]) == 2
    assert "which the command reads" in capsys.readouterr().err
    assert held(where) == before


def test_a_dataset_beside_its_logs_may_be_made_again(rig: Path, tmp_path: Path) -> None:
    """It is not read with them: a log counts once."""
    logs = tmp_path / "logs"
    shutil.copytree(rig / "logs", logs)
    for _ in range(2):
        assert main.run(["ingest", str(logs), "-o", str(logs / "data.h5"), "--force", "-q"]) == 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name here")
@pytest.mark.parametrize("out", ["pipe", "/dev/null"])
@pytest.mark.parametrize(
    "line",
    [
        "ingest data.h5", "fit data.h5", "tune-rc fit.json", "simulate fit.json --scenario steps", "couple fit.json",
        "plan fit.json --no-check", "plan fit.json --excitation --no-check", "synth", "export gains.json --anyway",
        "report fit.json", "demo",
    ],
)  # fmt: skip
def test_devices_and_pipes_are_never_replaced(
    line: str, out: str, rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(rig)
    os.mkfifo(tmp_path / "pipe")
    assert main.run([*line.split(), "-o", str(tmp_path / out), "--force"]) == 2  # an absolute `out` stays as it is
    assert "\nerror: " in "\n" + capsys.readouterr().err
    assert (tmp_path / "pipe").is_fifo() and Path("/dev/null").is_char_device()


@pytest.mark.parametrize("line", ["fit", "ingest", "report", "plan", "tune-rc", "export", "simulate", "couple"])
def test_an_empty_name_is_no_folder(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([line, ""]) == 2
    assert "an empty word stands among the arguments" in capsys.readouterr().err
