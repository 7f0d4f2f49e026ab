"""The command lines on the page make the same gains and the same replay again."""

import shlex
from pathlib import Path

import pytest

from eaid.cli import main
from eaid.report.page.next_steps import commands
from eaid.report.results import read_results
from eaid.results import codec
from eaid.results.gains import Gains

TUNED = ["--b-hat", "minimax", "--kp", "5", "--phi", "0.02", "--pi-overshoot", "1", "--pi-settling", "0.3",
         "--duty-limits", "5,95", "--reference", "multisine", "--bounds-levels", "40:100", "--pwm-hz", "0"]  # fmt: skip
REPLAYED = ["--controller", "pi,inverse", "--scenario", "steps", "--duration", "9", "--rate-hz", "500",
            "--noise-nm", "0.01",
            "--ripple-pct", "2", "--duty-bits", "8", "--perturb", "Ts=0.9", "--no-saturation",
            "--seed", "5"]  # fmt: skip


@pytest.mark.slow
def test_gains_and_replay_are_made_again_by_what_the_page_says(
    files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    fit = str(files["clutch.json"])
    assert main.run(["tune-rc", fit, "-o", "g.json", "-q", *TUNED]) == 0
    assert main.run(["simulate", fit, "--gains", "g.json", "-o", "r.h5", "-q", *REPLAYED]) == 0
    lines = commands(read_results([Path(fit), Path("g.json"), Path("r.h5")]))
    tune, replay = (next(line for line in lines if line.startswith(f"eaid {name}")) for name in ("tune-rc", "simulate"))
    before = codec.read(Path("g.json"), "gains", Gains)[0]
    assert main.run([*shlex.split(tune)[1:], "--force", "-q"]) == 0
    assert codec.read(Path("g.json"), "gains", Gains)[0] == before
    first = Path("r.h5").read_bytes()
    assert main.run([*shlex.split(replay)[1:], "--force", "-q"]) == 0
    assert Path("r.h5").read_bytes() == first
    assert "--duration 9" in replay and "--rate-hz 500" in replay
