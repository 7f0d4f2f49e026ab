"""Small result files of every kind, made once by the commands themselves, and a browser where one is installed."""

import contextlib
import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from eaid.cli.main import run

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")


def call(*arguments: str | Path) -> int:
    """One command, its tables not shown."""
    with contextlib.redirect_stdout(io.StringIO()):
        return run([str(argument) for argument in arguments])


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Name → file: data, fits, gains and replays of small synthetic sets."""
    folder = tmp_path_factory.mktemp("results")
    made = {}
    sets = {
        "clutch": ("20,40,60,80,100", "20", "50", "4"),
        "friction-force": ("17,51,85,119,153,170", "30", "50", "0"),
        "friction-speed": ("5,10,15,25,40", "30", "50", "0"),
    }
    for kind, (levels, hold, rate, release) in sets.items():
        data, fit = folder / f"{kind}.h5", folder / f"{kind}.json"
        how = ["--levels", levels, "--repeats", "2", "--hold", hold, "--idle", "2", "--rate-hz", rate]
        assert call("synth", "--kind", kind, *how, "--release", release, "-o", data, "-q") == 0
        assert call("fit", data, "-o", fit, "-q") == 0
        made |= {f"{kind}.h5": data, f"{kind}.json": fit}
    fit, gains = made["clutch.json"], folder / "gains.json"
    assert call("tune-rc", fit, "-o", gains, "-q") == 0
    made["gains.json"] = gains
    for scenario, more in (("steps", ["9"]), ("multisine", ["8"]), ("rehab", ["60"]), ("sweep", [])):
        path = folder / f"{scenario}.h5"
        length = ["--duration", *more] if more else []
        assert call("simulate", fit, "--gains", gains, "--scenario", scenario, *length, "-o", path, "-q") == 0
        made[f"{scenario}.h5"] = path
    return made


@pytest.fixture(scope="session")
def page(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of all of them."""
    folder = tmp_path_factory.mktemp("page") / "report"
    assert call("report", *files.values(), "-o", folder, "-q") == 0
    return folder / "report.html"


@pytest.fixture(scope="session")
def others(files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Name → page: a log as recorded, steps from level to level, two fits, a loop, a marked fit of long names."""
    folder = tmp_path_factory.mktemp("others")
    reading = {"random": (), "staircase": ("--logs-as", "steps")}
    made: dict[str, list[Path]] = {}
    for kind, more in reading.items():
        logs, fit = folder / kind, folder / f"{kind}.json"
        shape = ["--shape", "duration_s=120", "--rate-hz", "50", "--seed", "1"]
        assert call("synth", "--excitation", kind, *shape, "-o", logs, "-q") == 0
        assert call("fit", logs, *more, "-o", fit, "-q") in (0, 4)
        made[kind] = [fit]
    assert call("ingest", folder / "staircase", "-o", folder / "staircase.h5", "-q") == 0
    made["staircase"].append(folder / "staircase.h5")
    logs = folder / "long"
    levels = ["--levels", "20,60,100", "--repeats", "1", "--hold", "3", "--rate-hz", "50", "--seed", "8"]
    assert call("synth", *levels, "-o", logs, "-q") == 0
    for path in sorted(logs.iterdir()):
        words = path.read_text(encoding="utf-8").replace("duty_pct", "voltage_V")
        path.with_name(f"20241103_14_51_30_bts_dx=1.5_Fpre=-1g_f=1000_brass_{path.name}").write_text(words)
        path.unlink()
    made["long"] = [folder / name for name in ("long.json", "long.h5", "long-gains.json", "long-steps.h5")]
    fit, data, gains, replay = made["long"]
    assert call("ingest", logs, "-o", data, "-q") == 0 and call("fit", data, "-o", fit, "-q") in (0, 4)
    assert call("tune-rc", fit, "--allow-unidentified", "-o", gains, "-q") == 0
    assert call("simulate", fit, "--gains", gains, "--scenario", "steps", "--duration", "9", "-o", replay, "-q") == 0
    made["two"] = [files["clutch.json"], folder / "day2.json"]
    assert call("synth", "--levels", "20:100:20", "--seed", "9", "--rate-hz", "50", "-o", folder / "day2.h5", "-q") == 0
    assert call("fit", folder / "day2.h5", "-o", folder / "day2.json", "-q") == 0
    shape = ["--shape", "duration_s=60,gains=15:200,hold_s=0.5:5", "--rate-hz", "50", "--seed", "1"]
    assert call("synth", "--excitation", "closed-loop", *shape, "-o", folder / "loop", "-q") == 0
    assert call("ingest", "--edges", folder / "loop", "-o", folder / "loop.h5", "-q") == 0
    made["loop"] = [folder / "loop.h5"]
    for name, given in made.items():
        assert call("report", *given, "-o", folder / f"page-{name}", "-q") == 0
    return {name: folder / f"page-{name}/report.html" for name in made}


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Headless Chromium through Playwright; the tests that want it are skipped where it is not installed."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser installed (looked for {', '.join(BROWSERS)})")
    with playwright.sync_playwright() as driver:
        # The page is our own file; a sandbox inside a container without user namespaces would not start.
        opened = driver.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield opened
        opened.close()
