"""Outputs are whole or not there, and never overwritten by accident."""

import os
import re
from pathlib import Path

import pytest

from eaid import files
from eaid.errors import UsageError

LEFT_OVER = re.compile(r"\.fit\.json\.[0-9a-f]{12}\.part")


def names(folder: Path) -> list[str]:
    return sorted(item.name for item in folder.iterdir())


def test_an_existing_output_is_left_alone_without_force_also_where_it_appears_meanwhile(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    with pytest.raises(UsageError, match="exists already"), files.written_whole(target) as (part,):
        part.write_text("ours")
        target.write_text("theirs")
    with pytest.raises(UsageError, match="exists already; give force="), files.written_whole(target):
        pass
    assert target.read_text() == "theirs"


def test_a_missing_folder_is_named_and_a_name_of_two_hundred_letters_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the folder .* does not exist"), files.written_whole(tmp_path / "no" / "a"):
        pass
    with files.written_whole(tmp_path / ("é" * 115 + ".json")) as (part,):
        part.write_text("whole")
    assert names(tmp_path) == ["é" * 115 + ".json"]


def test_what_killed_writers_left_is_cleared_away_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    others = [".gains.json.0123456789ab.part", ".fit.json.mine.part", "fit.json.part"]  # of another output, of others
    dead, dead_folder = (tmp_path / f".fit.json.{token * 12}.part" for token in "ad")
    dead_folder.mkdir()
    for item in (dead, dead_folder / "half", *(tmp_path / name for name in others)):
        item.write_text("half")
    for item in tmp_path.iterdir():
        os.utime(item, (0, 0))
    with files.written_whole(target) as (part,):
        assert LEFT_OVER.fullmatch(part.name) and not dead.exists() and not dead_folder.exists()
        with files.written_whole(target, force=True) as (second,):
            assert part.exists()  # the first writer is still at work
            second.write_text("second")
        part.write_text("first")
        target.unlink()
    assert names(tmp_path) == sorted([*others, "fit.json"]) and target.read_text() == "first"


def test_outputs_that_belong_together_come_together(tmp_path: Path) -> None:
    pair = (tmp_path / "plan.csv", tmp_path / "plan.duty.csv")
    with pytest.raises(RuntimeError), files.written_whole(*pair) as parts:
        parts[0].write_text("whole")
        raise RuntimeError
    assert names(tmp_path) == []
    with files.written_whole(*pair) as parts:
        for part in parts:
            part.write_text("whole")
    assert [path.read_text() for path in pair] == ["whole", "whole"] and len(names(tmp_path)) == 2


@pytest.mark.parametrize("at_once", [True, False])
def test_a_folder_is_replaced_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: bool) -> None:
    folder = tmp_path / "logs"
    if not at_once:
        monkeypatch.setattr(files, "_exchanged", lambda *_: False)
    for written in (("a.csv", "b.csv"), ("b.csv", "c.csv")):
        with files.folder_written_whole(folder, lambda _path, _ends: True) as part:
            for name in written:
                (part / name).write_text(f"{name} of {written}")
            assert not folder.exists() or names(folder) == ["a.csv", "b.csv"]
        assert {item.name: item.read_text() for item in folder.iterdir()} == {n: f"{n} of {written}" for n in written}
        assert names(tmp_path) == ["logs"]
    with pytest.raises(RuntimeError), files.folder_written_whole(folder, lambda _path, _ends: True) as part:
        (part / "half.csv").write_text("half")
        raise RuntimeError
    assert names(folder) == ["b.csv", "c.csv"] and names(tmp_path) == ["logs"]
