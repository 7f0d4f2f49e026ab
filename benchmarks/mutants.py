"""Small wrong changes, one at a time: how many of them do the tests of a room see?

    make mutants                       a sample of every room below
    make mutants ROOMS=steps N=50      one room, 50 mutants
    python -m benchmarks.mutants steps --only cut.py --seed 3

cosmic-ray makes the mutants (operators, comparisons, numbers, signs, loops). Each is tried in a copy of the tree:
first on the tests that ran its line, quickest first, then, if they all pass, on every test of the room. A process
with NumPy, SciPy, pandas and numba already imported is forked for each. A survivor is printed as a diff; whether it
changes behaviour at all (`<` for `<=` between floats seldom does) is for the reader to say.
"""

import argparse
import ast
import difflib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = ("logs", "steps", "control", "replay", "estimate")
OPERATORS = (
    *(f"ReplaceBinaryOperator_{pair}" for pair in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "Mod_Mul")),
    *(f"ReplaceBinaryOperator_{pair}" for pair in ("FloorDiv_Mul", "BitAnd_BitOr", "BitOr_BitAnd")),
    *(f"ReplaceComparisonOperator_{pair}" for pair in ("Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt", "Lt_Gt", "Gt_Lt")),
    *(f"ReplaceComparisonOperator_{pair}" for pair in ("Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is")),
    *("ReplaceUnaryOperator_USub_UAdd", "ReplaceUnaryOperator_Delete_Not", "AddNot", "NumberReplacer"),
    *("ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop"),
)
Mutant = tuple[str, str, int, int]  # file, operator, its occurrence, line


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
    tree, skipped, found = get_ast(source), annotation_lines(source), []
    for name in OPERATORS:
        operator = get_operator(f"core/{name}")()
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        found += [(str(path), name, at, start[0]) for at, start in enumerate(places) if tuple(start) not in skipped]
    return found


def forked(tests: list[str], tree: Path, seconds: float, plugins: tuple[object, ...] = ()) -> int:
    """Pytest's exit code on these tests in a fork of this process; -1 when time ran out."""
    child = os.fork()
    if child == 0:
        os.setsid()
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        os.chdir(tree)
        sys.path.insert(0, str(tree))
        import pytest

        code = 1
        try:
            quick = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "--no-header", *tests]
            code = int(pytest.main(quick, list(plugins)))
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
    """A pytest plugin: which lines each test ran (coverage.py), and how long it took."""

    def __init__(self, tree: Path, room: str) -> None:
        import coverage

        self.file = tree / f".lines-{room}"
        self.coverage = coverage.Coverage(data_file=None, source=[str(tree / "eaid" / room)], config_file=False)
        self.seconds: dict[str, float] = {}

    def pytest_sessionstart(self) -> None:
        self.coverage.start()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.coverage.switch_context(nodeid)
        self.seconds[nodeid] = time.perf_counter()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self.seconds[nodeid] = time.perf_counter() - self.seconds[nodeid]

    def pytest_sessionfinish(self) -> None:
        self.coverage.stop()
        data = self.coverage.get_data()
        with self.file.open("w", encoding="utf-8") as out:
            for nodeid, seconds in sorted(self.seconds.items(), key=lambda item: item[1]):
                out.write(f"T {seconds:.3f} {nodeid}\n")
            for name in data.measured_files():
                for line, tests in data.contexts_by_lineno(name).items():
                    out.writelines(f"L {name}:{line} {test}\n" for test in tests if test)


def watched(tree: Path, room: str, folders: list[str]) -> tuple[list[str], dict[str, list[str]], float]:
    """All tests of a room, quickest first; the tests that ran each line; the seconds of a whole run."""
    watch, start = Watch(tree, room), time.monotonic()
    code = forked(folders, tree, 1800.0, (watch,))
    if code != 0:
        raise SystemExit(f"the tests of {room} do not pass as they are (exit {code}): see to that first")
    tests: list[str] = []
    by_line: dict[str, list[str]] = defaultdict(list)
    for row in watch.file.read_text(encoding="utf-8").splitlines():
        kind, key, test = row.split(" ", 2)
        if kind == "T":
            tests.append(test)
        else:
            by_line[key].append(test)
    order = {test: at for at, test in enumerate(tests)}
    return tests, {key: sorted(few, key=order.__getitem__) for key, few in by_line.items()}, time.monotonic() - start


def tried(mutant: Mutant, tree: Path, tests: list[str], by_line: dict[str, list[str]], seconds: float) -> str | None:
    """The diff of a mutant that no test sees; None for one that is killed."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    name, operator, occurrence, line = mutant
    path = Path(name)
    source, stamp = path.read_text(encoding="utf-8"), path.stat()
    changed = mutate_code(source, get_operator(f"core/{operator}")(), occurrence)
    if changed is None:
        return None
    for stale in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        stale.unlink()
    path.write_text(changed, encoding="utf-8")
    try:
        compile(changed, name, "exec")
        nearest = by_line.get(f"{path}:{line}", [])
        if nearest and forked(nearest[:40], tree, 3 * seconds + 30) != 0:
            return None
        if forked(tests, tree, 3 * seconds + 30) != 0:
            return None
    except SyntaxError:
        return None
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
        for stale in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            stale.unlink()
    where = path.relative_to(tree)
    lines = difflib.unified_diff(source.splitlines(), changed.splitlines(), str(where), str(where), "", "", 0, "")
    return "\n".join(lines)


def main(words: list[str] | None = None) -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("rooms", nargs="*", default=ROOMS)
    options.add_argument("-n", type=int, default=60, help="mutants a room (60)")
    options.add_argument("--seed", type=int, default=0, help="which sample (0)")
    options.add_argument("--only", help="only files whose path holds this")
    options.add_argument("--tests", nargs="*", help="test folders or files in place of tests/ROOM")
    given = options.parse_args(words)

    for module in ("optimize", "stats", "signal", "linalg"):
        __import__(f"scipy.{module}")  # before the forks, so that none of them pays for it
    for module in ("pandas", "numba", "h5py", "hypothesis"):
        __import__(module)
    rows = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        tree = Path(folder) / "tree"
        for name in subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0"):
            if name.endswith((".py", ".toml", ".h5", ".json", ".csv", ".md", ".html", ".css", ".js")):
                (tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, tree / name)
        os.environ["PYTHONPATH"] = str(tree)  # of the processes that tests start
        os.environ["NUMBA_CACHE_DIR"] = str(tree / ".numba")
        for room in given.rooms:
            tests, by_line, seconds = watched(tree, room, given.tests or [f"tests/{room}"])
            files = [p for p in sorted((tree / "eaid" / room).rglob("*.py")) if not given.only or given.only in str(p)]
            every = [mutant for path in files for mutant in mutants_of(path)]
            sample = random.Random(given.seed).sample(every, min(given.n, len(every)))
            size = f"{len(sample)} of {len(every)} mutants, {len(tests)} tests, {seconds:.0f} s a run"
            print(f"\n## {room}: {size}", flush=True)
            alive = 0
            for at, mutant in enumerate(sample, start=1):
                diff = tried(mutant, tree, tests, by_line, seconds)
                if diff:
                    alive += 1
                    print(f"\nsurvivor {alive} (mutant {at} of {len(sample)}):\n{diff}", flush=True)
            rows.append((room, len(sample), len(sample) - alive))
    print("\n| room | mutants tried | killed | % |\n|---|---|---|---|")
    for room, count, killed in rows:
        print(f"| {room} | {count} | {killed} | {100 * killed / max(count, 1):.0f} |")


if __name__ == "__main__":
    main()
