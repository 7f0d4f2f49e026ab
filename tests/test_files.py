"""Outputs are whole or not there, and never overwritten by accident."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from eaid import files
from eaid.errors import UsageError
from eaid.files import all_written_whole, folder_written_whole, refuse_to_overwrite, sha256_of, written_whole
from eaid.logs.folders import files_read

LEFT_OVER = re.compile(r"\.fit\.json\.[0-9a-f]{6}-\d+\.[^.]+\.part")


def test_a_finished_block_leaves_the_file_alone_in_its_folder(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    with written_whole(target) as part:
        part.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["fit.json"]


def test_a_failure_keeps_the_earlier_result_and_leaves_no_part(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    target.write_text("old")
    with pytest.raises(RuntimeError), written_whole(target, force=True) as part:
        part.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["fit.json"]


def test_an_existing_output_is_left_alone_without_force(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    target.write_text("old")
    with pytest.raises(UsageError, match="exists already; give force="), written_whole(target):
        pass
    assert target.read_text() == "old"


def test_an_output_that_appears_meanwhile_is_left_alone_too(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    with pytest.raises(UsageError, match="exists already"), written_whole(target) as part:
        part.write_text("ours")
        target.write_text("theirs")
    assert target.read_text() == "theirs"


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the folder .* does not exist"), written_whole(tmp_path / "no" / "fit.json"):
        pass


def test_sha256_is_the_known_one_of_abc(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256_of(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_what_killed_writers_left_is_cleared_away_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    with written_whole(target) as part:
        mark = part.name.split("-")[0]
        assert LEFT_OVER.fullmatch(part.name)
        dead = tmp_path / f"{mark}-{gone.pid}.x1.part"
        dead.write_text("half")
        others = [f".gains.json.{mark[-6:]}-{gone.pid}.x.part", f".fit.json.000000-{gone.pid}.x.part", "fit.json.part"]
        for name in others:  # of another output, of another machine, of no command of eaid
            (tmp_path / name).write_text("theirs")
        with written_whole(target, force=True) as second:
            assert part.exists() and not dead.exists()  # the first writer is still at work
            second.write_text("second")
        part.write_text("first")
        target.unlink()
    assert sorted(item.name for item in tmp_path.iterdir()) == sorted([*others, "fit.json"])
    assert target.read_text() == "first"


def test_outputs_that_belong_together_come_together(tmp_path: Path) -> None:
    pair = (tmp_path / "plan.csv", tmp_path / "plan.duty.csv")
    with pytest.raises(RuntimeError), all_written_whole(pair) as parts:
        parts[0].write_text("whole")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    with all_written_whole(pair) as parts:
        for part in parts:
            part.write_text("whole")
    assert [path.read_text() for path in pair] == ["whole", "whole"]
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("at_once", [True, False])
def test_a_folder_is_replaced_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: bool) -> None:
    folder = tmp_path / "logs"
    if not at_once:
        monkeypatch.setattr(files, "_exchanged", lambda *_: False)
    for names in (("a.csv", "b.csv"), ("b.csv", "c.csv")):
        with folder_written_whole(folder) as part:
            for name in names:
                (part / name).write_text(f"{name} of {names}")
            assert not folder.exists() or sorted(item.name for item in folder.iterdir()) == ["a.csv", "b.csv"]
        assert {item.name: item.read_text() for item in folder.iterdir()} == {n: f"{n} of {names}" for n in names}
        assert list(tmp_path.iterdir()) == [folder]
    with pytest.raises(RuntimeError), folder_written_whole(folder) as part:
        (part / "half.csv").write_text("half")
        raise RuntimeError
    assert sorted(item.name for item in folder.iterdir()) == ["b.csv", "c.csv"]
    assert list(tmp_path.iterdir()) == [folder]


def test_a_name_of_two_hundred_letters_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / ("é" * 115 + ".json")
    with written_whole(target) as part:
        part.write_text("whole")
    assert [item.name for item in tmp_path.iterdir()] == [target.name]


def test_what_the_command_reads_is_never_its_output(tmp_path: Path) -> None:
    log = tmp_path / "logs" / "a.csv"
    log.parent.mkdir()
    log.write_text("raw")
    (tmp_path / "link.csv").symlink_to(log)
    for path, inputs in ((log, [log]), (log, files_read([log.parent])), (tmp_path / "link.csv", [log])):
        with pytest.raises(UsageError, match="what the command reads"):
            refuse_to_overwrite(path, True, inputs)
    (tmp_path / "fit.json").write_text("old")
    refuse_to_overwrite(tmp_path / "fit.json", True, [log, tmp_path / "not-there"])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name here")
def test_only_regular_files_are_ever_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null"), tmp_path):
        with pytest.raises(UsageError, match="no regular file"), written_whole(path, True) as part:
            part.write_text("x")
    assert (tmp_path / "pipe").is_fifo()
