"""The examples of the public docstrings run, and the tutorial's outputs are those of today's code."""

import ast
import doctest
import importlib
import re
from pathlib import Path

import numpy as np
import pytest

import eaid

from ..conftest import made_once

ROOT = Path(__file__).parents[2]
FUNCTIONS = ("read", "fit", "tune_rc", "simulate", "report", "plan", "synth", "export", "couple", "load")
RESULTS = {"Coupling", "Fit", "Gains", "Guarantee", "Plan", "Replay", "StepSet"}
WITH_EXAMPLES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted((ROOT / "eaid").rglob("*.py"))
    if "\n    >>> " in path.read_text(encoding="utf-8") or "\n>>> " in path.read_text(encoding="utf-8")
}
"""Module → file."""
ONCE = {name: made_once(getattr(eaid, name)) for name in ("fit", "tune_rc")}
"""Most examples begin with the same fit and its gains."""


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_examples_of_the_docstrings_run(name, monkeypatch):
    for function, kept in ONCE.items():
        monkeypatch.setattr(eaid, function, kept)
    found = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert found.failed == 0 and found.attempted > 0


def test_every_public_function_and_result_has_an_example():
    assert [name for name in FUNCTIONS if ">>> " not in getattr(eaid, name).__doc__] == []
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in WITH_EXAMPLES.values()]
    classes = [node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)]
    assert {one.name for one in classes if ">>> " in (ast.get_docstring(one) or "")} >= RESULTS


def value_of(source, names):
    """What a notebook would show below the cell: the value of its last expression."""
    tree = ast.parse(re.sub(r"^%.*$", "", source, flags=re.MULTILINE))
    end = tree.body[-1]
    last = ast.Expression(end.value) if isinstance(end, ast.Expr) and tree.body.pop() else None
    exec(compile(tree, "tutorial", "exec"), names)
    return None if last is None else eval(compile(last, "tutorial", "eval"), names)


def numbers(text):
    return [float(word) for word in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text)]


def test_the_tutorial_shows_what_its_code_gives(tmp_path, monkeypatch):
    import matplotlib
    import nbformat

    matplotlib.use("Agg")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    notebook = nbformat.read(ROOT / "docs" / "tutorial.ipynb", 4)
    names = {}
    for cell in (cell for cell in notebook.cells if cell.cell_type == "code"):
        value = value_of(cell.source, names)
        kept = [out["data"]["text/plain"] for out in cell.outputs if "text/plain" in out.get("data", {})]
        if kept and "Figure" not in kept[-1] and "say(" not in cell.source:  # sentences may be reworded
            assert numbers(repr(value)) == pytest.approx(numbers(kept[-1]), rel=1e-3, abs=1e-4), cell.source
    truth = names["fit"].to_frame()
    assert truth["tau1"].to_numpy() == pytest.approx(np.full(5, 0.4), rel=0.02)
    assert (folder := names["folder"]).is_dir() and (folder / "report" / "report.html").is_file()


def test_the_readmes_notebook_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1).save("logs")
    block = (ROOT / "README.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    names = {}
    exec(block, names)
    assert names["fit"].verdict.usable and set(names["run"].to_frame()["name"]) == {"rc", "pi"}
    assert (tmp_path / "notebook-report" / "report.html").is_file()
