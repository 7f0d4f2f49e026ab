"""What surrounds the code: the workflows, the hooks before a commit, the site's contents, the one version."""

import ast
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import eaid

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


class Loader(yaml.SafeLoader):
    """YAML whose tags of other languages (mkdocs names Python functions) are passed over."""


Loader.add_multi_constructor("", lambda *_: None)


def program(name: str) -> str:
    found = shutil.which(name, path=str(BIN)) or shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def ran(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_the_workflows_are_what_github_takes() -> None:
    assert {path.name for path in WORKFLOWS} == {"ci.yml", "nightly.yml", "release.yml"}
    checked = ran(
        program("check-jsonschema"), "--builtin-schema", "vendor.github-workflows", *(str(path) for path in WORKFLOWS)
    )
    assert checked.returncode == 0, checked.stdout


def test_the_workflows_open_no_door() -> None:
    checked = ran(program("zizmor"), "--offline", ".github/workflows")
    assert checked.returncode == 0, checked.stdout


def test_the_hooks_before_a_commit_run_programs_of_the_dev_extra() -> None:
    (repo,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert {hook["id"] for hook in repo["hooks"]} >= {"ruff", "format", "layers", "types", "workflows"}
    for hook in repo["hooks"]:
        assert hook["language"] == "system"
        program(hook["entry"].split()[0])


def pages(part: object) -> list[str]:
    if isinstance(part, str):
        return [part]
    return [page for item in (part.values() if isinstance(part, dict) else part) for page in pages(item)]  # type: ignore[attr-defined]


def test_the_site_has_every_page_and_no_other() -> None:
    site = yaml.load((ROOT / "mkdocs.yml").read_text(), Loader)
    made = {"reference/commands.md"}  # by docs/hooks.py, while the site is built
    named = set(pages(site["nav"]))
    left_out = set(site["exclude_docs"].split())
    docs = ROOT / "docs"
    there = {path.relative_to(docs).as_posix() for end in ("*.md", "*.ipynb") for path in docs.rglob(end)}
    assert named == (there - left_out) | made


def test_the_version_stands_in_one_file() -> None:
    version = re.search(r'"(.+)"', (ROOT / "eaid/version.py").read_text().split("__version__")[1])
    assert version is not None
    assert eaid.__version__ == version[1]
    others = [
        path.name for path in [*(ROOT / "eaid").rglob("*.py"), ROOT / "pyproject.toml"]
        if f'"{version[1]}"' in path.read_text(encoding="utf-8") and path.name != "version.py"
    ]  # fmt: skip
    assert others == []
    assert (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").count(f"## [{version[1]}]") == 1


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    if importlib.util.find_spec("mkdocs") is None or importlib.util.find_spec("mkdocstrings") is None:
        pytest.skip("mkdocs is not installed: pip install .[docs]")
    built = ran(sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path))
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "reference" / "commands" / "index.html").is_file()


# Rows of one table, tables of sentences, two ways to draw, entry points, type variables
SEVERAL = {"ROWS", "R", "T", "__all__", "_name_ends", "design", "law", "main", "tables_of"}


def test_a_name_has_one_meaning() -> None:
    """What one module defines no other does; a command has its name in the API, on the command line and in its room."""
    modules: dict[str, set[Path]] = {}
    for path in (ROOT / "eaid").rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]
            parts = [part for one in targets for part in (one.elts if isinstance(one, ast.Tuple) else [one])]
            for part in parts:
                name = getattr(part, "id", None) or getattr(part, "name", None)
                if isinstance(name, str) and path.name != "reference.py":  # the program of an export, which is alone
                    modules.setdefault(name, set()).add(path)
    assert not {name for name, where in modules.items() if len(where) > 1} - SEVERAL - set(dir(eaid))
