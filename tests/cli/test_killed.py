"""kill -9 at any moment of any command: earlier outputs stay whole, and no final name ever holds half a file.

Every command is killed on top of an earlier output: at operations on files chosen by a seed, and at random instants.
What may be left over is named `.NAME.….part`, and the next run clears it away. `EAID_KILLS=50` kills each command so
many times, in place of a few.
"""

import json
import os
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import eaid
from eaid.cli.main import run

KILLS = int(os.environ.get("EAID_KILLS", "0"))
LEFT_OVER = re.compile(r"\.(?P<name>.+)\.[0-9a-f]{6}-\d+\.[^.]+\.part")

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")]


class Server:
    """The process that runs and kills commands."""

    def __init__(self) -> None:
        script = Path(__file__).with_name("kill_server.py")
        self.process = subprocess.Popen(
            [sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._line() == "ready"

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def __call__(self, folder: Path, arguments: list[str], **when: float | None) -> dict[str, Any]:
        assert self.process.stdin is not None
        errors = str(folder.parent / "stderr.txt")
        order = {"folder": str(folder), "arguments": arguments, "errors": errors, **when}
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()
        return dict(json.loads(self._line()))


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    found = Server()
    yield found
    found.process.stdin.close()  # type: ignore[union-attr]
    found.process.wait(timeout=30)


@pytest.fixture(scope="module")
def given(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What commands read: `made`, and a replay."""
    folder = tmp_path_factory.mktemp("given") / "rig"
    shutil.copytree(made, folder)
    replayed = ["simulate", f"{folder}/fit.json", "--controller", "inverse", "--duration", "2", "-q"]
    assert run([*replayed, "-o", f"{folder}/replay.h5"]) == 0
    return folder


COMMANDS: dict[str, tuple[str, int]] = {
    "ingest {given}/logs -o data.h5": ("ingest", 2),
    "ingest logs --write-manifest -o data.h5": ("ingest with a manifest", 2),
    "fit {given}/data.h5 --model linear --ci none -o fit.json": ("fit", 2),
    "fit {given}/data.h5 --model linear --ci bootstrap -o fit.json": ("fit with a bootstrap", 1),
    "tune-rc {given}/fit.json -o gains.json": ("tune-rc", 2),
    "simulate {given}/fit.json --gains {given}/gains.json --scenario steps -o replay.h5": ("simulate", 2),
    "report {given}/fit.json {given}/gains.json {given}/replay.h5 -o page": ("report", 3),
    "synth --levels 30,60 --repeats 1 --seed 7 -o synth.h5": ("synth", 2),
    "synth --levels 30,60 --repeats 2 --seed 7 --rate-hz 20 --hold 5 -o folder": ("synth of a folder", 3),
    "plan {given}/fit.json --no-check -o plan.csv": ("plan", 3),
    **({"demo -o demo": ("demo", 2)} if KILLS else {}),
}
"""Command line → what it is called, and how often CI kills it at an operation on files."""
EARLIER: dict[str, str] = {"folder": "synth --levels 20,50 --repeats 3 --seed 1 --rate-hz 20 --hold 5 -o folder"}
"""Outputs that an earlier command makes; all others begin as the new ones with a line behind them."""


def held(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def left_over(name: str) -> bool:
    return any(LEFT_OVER.fullmatch(part) for part in Path(name).parts)


def check(work: Path, earlier: dict[str, bytes], new: dict[str, bytes], line: str) -> None:
    found = {name: content for name, content in held(work).items() if not left_over(name)}
    assert set(earlier) <= set(found) | (set(earlier) - set(new)), set(earlier) - set(found)
    for name, content in found.items():
        assert content in (earlier.get(name), new.get(name)), (line, name)
    if "-o folder" in line:
        assert found in (earlier, new)


@pytest.mark.parametrize("line", COMMANDS, ids=[name for name, _ in COMMANDS.values()])
def test_killed(line: str, given: Path, server: Server, tmp_path: Path) -> None:
    name, few = COMMANDS[line]
    arguments = [*line.replace("{given}", str(given)).split(), "-q", "--force"]
    work = tmp_path / "work"

    def prepared(content: Callable[[], None]) -> None:
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
        if "--write-manifest" in line:
            shutil.copytree(given / "logs", work / "logs")
        content()

    prepared(lambda: None)
    inputs = held(work)
    whole = server(work, arguments)
    assert whole["status"] == 0 and whole["orphans"] == 0, (tmp_path / "stderr.txt").read_text()
    new = held(work)
    assert len(new) > len(inputs)
    if (target := line.split()[-1]) in EARLIER:
        prepared(lambda: None)
        assert server(work, EARLIER[target].split())["status"] == 0
        earlier = held(work)
    else:
        earlier = {path: content if path in inputs else content + b"\n# earlier\n" for path, content in new.items()}

    def restore() -> None:
        for path, content in earlier.items():
            (work / path).parent.mkdir(parents=True, exist_ok=True)
            (work / path).write_bytes(content)

    chance = random.Random(line)
    operations = chance.sample(range(1, whole["operations"] + 1), min(KILLS or few, whole["operations"]))
    instants = [chance.uniform(0.0, whole["took_s"]) for _ in range(KILLS or (1 if whole["took_s"] < 1.5 else 0))]
    killed = 0
    for when in [*({"at_operation": n} for n in operations), *({"after_s": s} for s in instants)]:
        prepared(restore)
        done = server(work, arguments, **when)
        assert done["status"] in (0, -9) and done["orphans"] == 0, (done, (tmp_path / "stderr.txt").read_text())
        killed += done["status"] == -9
        check(work, earlier, new, line)
    assert killed >= min(len(operations), 1)
    if whole["took_s"] > 1.5 and not KILLS:
        return
    assert server(work, arguments)["status"] == 0  # on top of what the last kill left
    assert held(work) == new
    if KILLS:
        print(f"\n{name}: killed {killed} times, {len(operations)} of them at an operation of {whole['operations']}")


def test_demo_killed_early(server: Server, tmp_path: Path) -> None:
    """While its first results are written; the process beside it ends too. (All of it: with EAID_KILLS.)"""
    work = tmp_path / "work"
    for operation in (4, 9):
        shutil.rmtree(work, ignore_errors=True)
        (work / "demo").mkdir(parents=True)
        for name in ("clutch.h5", "fit.json", "friction-force.h5"):
            (work / "demo" / name).write_bytes(b"earlier")
        done = server(work, ["demo", "-o", "demo", "-q", "--force"], at_operation=operation)
        assert (done["status"], done["orphans"]) == (-9, 0), (tmp_path / "stderr.txt").read_text()
        for name, content in held(work).items():
            if content == b"earlier" or left_over(name):
                continue
            if name.endswith(".json"):  # the process beside it had got as far as a fit
                assert eaid.load(work / name).friction is not None  # type: ignore[union-attr]
            else:
                assert name.endswith(".h5") and eaid.read(work / name).runs, name
