"""`eaid report --watch` from end to end: a process of its own, a result that changes, a signal that ends it."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

PATIENCE_S = 120.0


def wait(process: "subprocess.Popen[str]", ready: Callable[[], bool]) -> None:
    """Until something holds; fails where the process ends or nothing happens."""
    ends = time.monotonic() + PATIENCE_S
    while not ready():
        assert process.poll() is None and time.monotonic() < ends
        time.sleep(0.1)


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_the_page_follows_its_results_until_a_signal(tmp_path: Path, stop: signal.Signals):
    fit, page = tmp_path / "fit.json", tmp_path / "out/report.html"
    content = {"schema": "eaid/fit/1", "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42}}
    fit.write_text(json.dumps(content))
    command = [sys.executable, "-m", "eaid", "report", str(fit), "-o", str(page.parent), "--watch"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        lines = iter(process.stderr.readline, "")
        assert next(line for line in lines if line.startswith("watching 1 file"))
        first = page.read_text(encoding="utf-8")
        assert "−2.420" in first
        fit.write_text("{")  # half written: told, and looked at again
        assert "is no result of eaid" in next(line for line in lines if "fit.json" in line)
        assert page.read_text(encoding="utf-8") == first
        content["linear"]["c0"] = -1.987  # type: ignore[index]
        fit.write_text(json.dumps(content))
        wait(process, lambda: "−1.987" in page.read_text(encoding="utf-8"))
        process.send_signal(stop)
        process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert process.returncode == 130
    assert sorted(path.name for path in page.parent.iterdir()) == ["figures", "report.html"]  # nothing half written
