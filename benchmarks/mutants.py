"""Small wrong changes, one at a time: how many of them do the tests of a room see?

    make mutants                       a sample of every room below
    make mutants ROOMS=steps N=50      one room, 50 mutants
    python -m benchmarks.mutants steps --only cut.py --seed 3

cosmic-ray makes the mutants (operators, comparisons, numbers, signs, loops). One run of the rooms' quick tests, of
the API's and of the kept numbers shows which of them ran each line, by themselves or by a fixture, and how long they
took. A mutant then meets, in a copy of the tree, the tests that ran its line, quickest first, or, where none did (in
machine code, or at import), for a minute those that ran its file. Each is tried in a fork of a process that has
imported all other packages. A survivor is printed as a diff; whether it changes behaviour at all (`<` for `<=` between
floats seldom does) is for the reader to say.
"""

import argparse
import ast
import difflib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Generator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("logs", "steps", "control", "replay", "estimate+recorded")
TESTS_S = 60.0
"""Processor time [s] of the tests that a mutant meets whose line no test ran."""
OPERATORS = (
    *(f"ReplaceBinaryOperator_{pair}" for pair in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "Mod_Mul")),
    *(f"ReplaceBinaryOperator_{pair}" for pair in ("FloorDiv_Mul", "BitAnd_BitOr", "BitOr_BitAnd")),
    *(f"ReplaceComparisonOperator_{pair}" for pair in ("Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt", "Lt_Gt", "Gt_Lt")),
    *(f"ReplaceComparisonOperator_{pair}" for pair in ("Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is")),
    *("ReplaceUnaryOperator_USub_UAdd", "ReplaceUnaryOperator_Delete_Not", "AddNot", "NumberReplacer"),
    *("ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop"),
)
Mutant = tuple[Path, str, int, int]  # file, operator, its occurrence, line


def annotation_lines(source: str) -> set[tuple[int, int]]:
    """The places (line, column) inside type annotations and decorators, where a mutant changes nothing that runs."""
    inside = set()
    for node in ast.walk(ast.parse(source)):
        parts = [getattr(node, name, None) for name in ("annotation", "returns")] + getattr(node, "decorator_list", [])
        for part in filter(None, parts):
            for leaf in ast.walk(part):
                if isinstance(leaf, ast.expr):
                    inside |= {(leaf.lineno, column) for column in range(leaf.col_offset, leaf.end_col_offset or 0)}
    return inside


def mutants_of(path: Path) -> list[Mutant]:
    """Every mutant of a file by the operators above."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    source = path.read_text(encoding="utf-8")
    tree, skipped, mutants = get_ast(source), annotation_lines(source), []
    for name in OPERATORS:
        operator = get_operator(f"core/{name}")()
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        mutants += [(path, name, at, start[0]) for at, start in enumerate(places) if tuple(start) not in skipped]
    return mutants


def forked(tests: list[str], tree: Path, seconds: float, plugins: tuple[object, ...] = ()) -> int:
    """Pytest's exit code on these quick tests in a fork of this process; -1 when time ran out."""
    child = os.fork()
    if child == 0:
        os.setsid()
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        os.chdir(tree)
        sys.path.insert(0, str(tree))
        code = 1
        try:
            words = ["-q", "-n", "0", "-m", "not slow", "-p", "no:cacheprovider", "--no-header", *tests]
            code = int(pytest.main(words if plugins else ["-x", *words], list(plugins)))
        finally:
            os._exit(code)
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


class Watch:
    """A pytest plugin: which lines each test and each fixture ran (coverage.py), and how long a test took."""

    def __init__(self, file: Path, sources: list[str]) -> None:
        import coverage

        self.file = file
        self.coverage = coverage.Coverage(data_file=None, source=sources, config_file=False)
        self.context = ""
        self.seconds: dict[str, float] = {}
        self.users: dict[str, list[str]] = defaultdict(list)
        self.failed: set[str] = set()

    def pytest_sessionstart(self) -> None:
        self.coverage.start()

    def switch(self, context: str) -> str:
        """The context before."""
        before, self.context = self.context, context
        self.coverage.switch_context(context)
        return before

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Generator[None, Any, Any]:
        for name in item.fixturenames:
            self.users[f"fixture {name}"].append(item.nodeid)
        self.switch(item.nodeid)
        start = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - start
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, Any, Any]:
        before = self.switch(f"fixture {fixturedef.argname}")
        result = yield
        self.switch(before)
        return result

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        self.coverage.stop()
        data = self.coverage.get_data()
        by_line: dict[str, list[str]] = {}
        for name in data.measured_files():
            for line, contexts in data.contexts_by_lineno(name).items():
                tests = [test for context in contexts if context for test in self.users.get(context, [context])]
                by_line[f"{name}:{line}"] = sorted(set(tests) - self.failed, key=self.seconds.__getitem__)
        tree = str(self.file.parent)
        outside = [name for name, module in sys.modules.items() if tree not in str(getattr(module, "__file__", ""))]
        # a benchmark would import the unchanged eaid beside it
        modules = [name for name in outside if name.partition(".")[0] not in ("benchmarks", "eaid")]
        seen = (self.seconds, by_line, modules, sorted(self.failed))
        self.file.write_text(json.dumps(seen), encoding="utf-8")


def tests_for(mutant: Mutant, seconds: dict[str, float], by_line: dict[str, list[str]]) -> list[list[str]]:
    """The ten quickest that ran its line, then the others; where none did, a minute of those that ran its file."""
    path, _, _, line = mutant
    tests = by_line.get(f"{path}:{line}", [])[:]
    if not tests:
        ran_file = {test for key, some in by_line.items() if key.startswith(f"{path}:") for test in some}
        ran_file = ran_file or set(seconds)  # a reader, in a process of its own
        total = 0.0
        for test in sorted(ran_file, key=seconds.__getitem__):
            total += seconds[test]
            if total < TESTS_S:
                tests.append(test)
    return [by_file(few) for few in (tests[:10], tests[10:]) if few]


def by_file(tests: list[str]) -> list[str]:
    """File after file, as pytest likes them."""
    first = {test.partition("::")[0]: at for at, test in reversed(list(enumerate(tests)))}
    return sorted(tests, key=lambda test: first[test.partition("::")[0]])


def survives(mutant: Mutant, tree: Path, tests: list[list[str]], seconds: dict[str, float]) -> str | None:
    """The diff of a mutant that these tests do not see; None for one that they kill."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    path, operator, occurrence, _ = mutant
    source, stamp = path.read_text(encoding="utf-8"), path.stat()
    changed = mutate_code(source, get_operator(f"core/{operator}")(), occurrence) or source
    path.write_text(changed, encoding="utf-8")
    try:
        within = (forked(few, tree, 60 + 5 * sum(map(seconds.__getitem__, few))) for few in tests)
        code = next(filter(None, within), 0)
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    where = str(path.relative_to(tree))
    if code == -1:
        print(f"\nout of time: {where}, line {mutant[3]}, {operator}", flush=True)
    if code != 0:
        return None
    return "\n".join(difflib.unified_diff(source.splitlines(), changed.splitlines(), where, where, "", "", 0, ""))


def main(words: list[str] | None = None) -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("rooms", nargs="*", default=ROOMS, help="names of folders; a+b are one room")
    options.add_argument("-n", type=int, default=60, help="mutants a room (60)")
    options.add_argument("--seed", type=int, default=0, help="which sample (0)")
    options.add_argument("--only", default="", help="only files whose path holds this")
    options.add_argument("--tests", nargs="*", help="test folders or files in place of tests/ROOM")
    given = options.parse_args(words)

    rows = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        tree = Path(folder) / "tree"
        for name in subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0"):
            if name:
                (tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, tree / name)
        os.environ["PYTHONPATH"] = str(tree)  # of the processes that tests start
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        sys.dont_write_bytecode = False  # so that a fork compiles no file but the mutant
        os.environ["NUMBA_CACHE_DIR"] = str(tree / ".numba")
        parts = [part for room in given.rooms for part in room.split("+")]
        watch, start = Watch(tree / ".lines", [str(tree / "eaid" / part) for part in parts]), time.monotonic()
        forked(given.tests or [f"tests/{part}" for part in (*parts, "api", "frozen")], tree, 7200.0, (watch,))
        seconds, by_line, modules, failed = json.loads(watch.file.read_text(encoding="utf-8"))
        print(f"{len(seconds)} tests, {time.monotonic() - start:.0f} s", flush=True)
        if failed:
            print("\nleft out, for they fail as they are:", *failed, sep="\n", flush=True)
        for module in modules:  # before the forks, so that none of them pays for it
            try:
                import_module(module)
            except Exception:
                continue
        assert "eaid" not in sys.modules, "every fork would run this eaid, and no mutant"
        for room in given.rooms:
            sources = [tree / "eaid" / part for part in room.split("+")]
            files = [path for source in sources for path in sorted(source.rglob("*.py")) if given.only in str(path)]
            every = [mutant for path in files for mutant in mutants_of(path)]
            sample = random.Random(given.seed).sample(every, min(given.n, len(every)))
            print(f"\n## {room}: {len(sample)} of {len(every)} mutants", flush=True)
            alive = 0
            for at, mutant in enumerate(sample, start=1):
                tests = tests_for(mutant, seconds, by_line)
                diff = survives(mutant, tree, tests, seconds)
                if diff:
                    alive += 1
                    print(f"\nsurvivor {alive} (mutant {at}, {sum(map(len, tests))} tests):\n{diff}", flush=True)
            rows.append((room, len(sample), len(sample) - alive))
    print("\n| room | mutants tried | killed | % |\n|---|---|---|---|")
    for room, count, killed in rows:
        print(f"| {room} | {count} | {killed} | {100 * killed / max(count, 1):.0f} |")


if __name__ == "__main__":
    main()
