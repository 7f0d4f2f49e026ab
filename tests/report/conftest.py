"""Small result files of every kind, made once by the commands themselves; a reader of pages; a browser where there is
one."""

import base64
import contextlib
import gzip
import io
import json
import re
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import html5lib
import numpy as np
import pytest

from eaid.cli.main import run

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")


def call(*arguments):
    """One command, its tables not shown."""
    with contextlib.redirect_stdout(io.StringIO()):
        return run([str(argument) for argument in arguments])


def words(node):
    return "" if node is None else re.sub(r"\s+", " ", "".join(node.itertext())).strip()


@dataclass
class Page:
    """What a page shows."""

    path: Path

    def __post_init__(self) -> None:
        self.html = self.path.read_text(encoding="utf-8")
        small = re.sub(r"data:image/png;base64,[^\"]*|<style>.*?</style>|(?<=<script>).*?(?=</script>)", "", self.html,
                       flags=re.DOTALL)  # fmt: skip
        self.root = html5lib.parse(small, namespaceHTMLElements=False)
        body = self.root.find("body")
        scripts = list(body.iter("script"))
        self.live = {}
        for figure in self.of("figure", "has-live"):
            (self.live[figure.get("id")],) = (json.loads(one.text) for one in figure.iter("script"))
        for one in scripts:
            one.text = ""
        self.text = words(body)
        self.tables: dict[str, list[list[str]]] = {}
        """Heading → rows of texts, the heads first."""
        first = [one for box in self.of("div", "numbers") for one in box]
        for one in (one for one in self.of("div", "tabled") if one not in first):
            rows = [[words(cell) for cell in row if cell.tag in ("th", "td")] for row in one.iter("tr")]
            self.tables.setdefault(words(one.find("h3")), rows)
        self.captions = {one.get("id"): words(one.find("figcaption")) for one in self.of("figure", "figure")}
        self.lights = [(one.get("class"), words(one.find("a/span"))) for one in self.of("ul", "lights")[0]]
        self.numbers = {words(one.find("h3")): [[words(cell) for cell in row] for row in one.iter("tr")]
                        for box in self.of("div", "numbers") for one in box if one.tag == "div"}  # fmt: skip
        """Tables of the first screen, the heads first."""
        self.steps = [(words(one.find("span")), words(one.find("code"))) for one in self.root.iter("li") if
                      one.find("code") is not None and one.find("button") is not None]  # fmt: skip
        self.chips = [words(one) for one in self.of("ul", "chips")[0]]
        self.title = words(self.root.find("body//h1"))

    def of(self, tag: str, kind: str = "") -> list[ET.Element]:
        return [one for one in self.root.iter(tag) if not kind or kind in (one.get("class") or "").split()]

    def rows(self, heading: str) -> list[list[str]]:
        """The rows of a table, without its heads."""
        return self.tables[heading][1:]

    def lines(self, figure: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Name → x and y of what can be hovered in the live plot of a figure."""

        def sources(node: Any) -> Iterator[dict[str, Any]]:
            if isinstance(node, dict):
                if node.get("name") == "ColumnDataSource":
                    yield node["attributes"]
                node = list(node.values())
            for one in node if isinstance(node, list) else ():
                yield from sources(one)

        found = {}
        for one in sources(self.live[figure]):
            if "name" in one:
                known = dict(one["data"]["entries"])
                held = [gzip.decompress(base64.b64decode(known[key]["array"]["data"])) for key in "xy"]
                x, y = (np.frombuffer(part, np.float32) for part in held)
                found[one["name"]] = x, y
        return found


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """`report(files…, "--figures", …)`: the page that the command writes of some files."""

    def made(*given):
        folder = tmp_path_factory.mktemp("made") / "report"
        assert call("report", *given, "-o", folder, "-q") == 0
        return Page(folder / "report.html")

    return made


@pytest.fixture(scope="session")
def report_of(report, tmp_path_factory):
    """`report_of({…}, {…})`: the page of results written as JSON, without figures but those named."""

    def made(*results, figures="own_reference", more=()):
        folder = tmp_path_factory.mktemp("json")
        paths = []
        for k, one in enumerate(results):
            paths.append(folder / f"{k}.json")
            paths[-1].write_text(json.dumps(one), encoding="utf-8")
        return report(*paths, "--figures", figures, *more)

    return made


@pytest.fixture(scope="session")
def replay_file():
    """A replay by the contract alone: three samples of the controllers in `metrics`, with `columns` instead."""

    def made(path, metrics, columns=None, **head):
        held = {"time_s": [0.0, 1.0, 2.0], "reference_nm": np.ones(3), "torque_nm": [0.0, 0.5, 0.75],
                "duty_pct": np.zeros(3), **(columns or {})}  # fmt: skip
        with h5py.File(path, "w") as file:
            file.attrs.update({"schema": "eaid/replay/1", "scenario": "steps", "output_unit": "N·m", **head})
            for name, known in metrics.items():
                file.create_group(name).attrs["metrics"] = json.dumps(held.get("metrics", known))
                for key in held.keys() - {"metrics"}:
                    if held[key] is not None:
                        file[name][key] = held[key]
        return path

    return made


@pytest.fixture(scope="session")
def whole(page):
    """The page of all files."""
    return Page(page)


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """Name → file: data, fits, gains and replays of small synthetic sets."""
    folder = tmp_path_factory.mktemp("results")
    made = {}
    sets = {"clutch": ("20,40,60,80,100", "20", "4"), "friction-force": ("17,51,85,119,153,170", "30", "0"),
            "friction-speed": ("5,10,15,25,40", "30", "0")}  # fmt: skip
    for kind, (levels, hold, release) in sets.items():
        data, fit = folder / f"{kind}.h5", folder / f"{kind}.json"
        how = ["--levels", levels, "--repeats", "2", "--hold", hold, "--idle", "2", "--rate-hz", "50"]
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
def page(files, tmp_path_factory):
    """The page of all of them."""
    folder = tmp_path_factory.mktemp("page") / "report"
    assert call("report", *files.values(), "-o", folder, "-q") == 0
    return folder / "report.html"


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """The fit of a log of each kind, as they were recorded."""
    folder = tmp_path_factory.mktemp("recorded")
    logs = [folder / kind for kind in ("random", "staircase", "chirp", "closed-loop")]
    for seed, log in enumerate(logs):
        shape = ["--shape", "duration_s=40", "--rate-hz", "50", "--seed", seed]
        assert call("synth", "--excitation", log.name, *shape, "-o", log, "-q") == 0
    assert call("fit", *logs, "-o", folder / "recorded.json", "-q") in (0, 4)
    return folder / "recorded.json"


@pytest.fixture(scope="session")
def others(recorded, tmp_path_factory):
    """Name → files: logs as recorded, steps from level to level."""
    folder = tmp_path_factory.mktemp("others")
    made = {"recorded": [recorded], "staircase": [folder / "staircase.json", folder / "staircase.h5"]}
    shape = ["--shape", "duration_s=120", "--rate-hz", "50", "--seed", "1"]
    assert call("synth", "--excitation", "staircase", *shape, "-o", folder / "staircase", "-q") == 0
    assert call("fit", folder / "staircase", "--logs-as", "steps", "-o", made["staircase"][0], "-q") in (0, 4)
    assert call("ingest", folder / "staircase", "-o", made["staircase"][1], "-q") == 0
    return made


@pytest.fixture(scope="session")
def long():
    """A marked fit of long names, its data, gains and replay, in a short folder: the page names it in its commands."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        logs = folder / "long"
        levels = ["--levels", "20,60,100", "--repeats", "1", "--hold", "3", "--rate-hz", "50", "--seed", "8"]
        assert call("synth", *levels, "-o", logs, "-q") == 0
        for path in sorted(logs.iterdir()):
            words = path.read_text(encoding="utf-8").replace("duty_pct", "voltage_V")
            path.with_name(f"20241103_14_51_30_bts_dx=1.5_Fpre=-1g_f=1000_brass_{path.name}").write_text(words)
            path.unlink()
        made = [folder / name for name in ("long.json", "long.h5", "long-gains.json", "long-steps.h5")]
        fit, data, gains, replay = made
        assert call("ingest", logs, "-o", data, "-q") == 0 and call("fit", data, "-o", fit, "-q") in (0, 4)
        assert call("tune-rc", fit, "--anyway", "-o", gains, "-q") == 0
        words = ("--scenario", "steps", "--duration", "9", "-o", replay, "-q")
        assert call("simulate", fit, "--gains", gains, *words) == 0
        yield made


@pytest.fixture(scope="session")
def browser():
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


@pytest.fixture(scope="session")
def printed():
    """The text of each printed page of a tab; of none where there is no pdftotext."""

    def pages(tab, folder):
        tab.emulate_media(media="print")
        tab.pdf(path=folder / "page.pdf", prefer_css_page_size=True, print_background=True)
        if (reader := shutil.which("pdftotext")) is None:
            return []
        command = [reader, "-layout", folder / "page.pdf", "-"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\f")[:-1]

    return pages
