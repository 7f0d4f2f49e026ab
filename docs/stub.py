"""eaid/__init__.pyi, what editors complete: the functions of `eaid.api` with every option as `eaid.options` has it.

python docs/stub.py writes it; a test holds it against the declaration.
"""

import ast
from pathlib import Path

import eaid
from eaid import options
from eaid.declared import keywords_of

ROOT = Path(__file__).parents[1]
STUB = ROOT / "eaid" / "__init__.pyi"
HEAD = '''"""Public names with their signatures; `python docs/stub.py` wrote this file."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pandas
from numpy.typing import ArrayLike
'''
FROM = {
    "eaid.apparatus": ["Apparatus"],
    "eaid.api.given": ["AnyResult", "File", "GivenTables", "OneColumn", "Paths"],
    "eaid.export.export": ["ExportFolder"],
    "eaid.options": ["Limits"],
    "eaid.progress": ["Progress"],
    "eaid.replay.controllers": ["OwnLaw"],
    "eaid.results.plan": ["Excitation"],
    "eaid.sessions.compare": ["Comparison"],
    "eaid.sessions.rig": ["Rig"],
    "eaid.version": ["__version__ as __version__"],
}


def stub() -> str:
    """The whole file, as ruff formats it."""
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in sorted((ROOT / "eaid" / "api").glob("*.py"))]
    each = [one for tree in trees for one in tree.body if isinstance(one, ast.FunctionDef)]
    functions = [one for one in each if one.name in eaid.__all__]
    types: dict[str, list[str]] = {}
    for name in set(eaid.__all__) - {one.name for one in functions} - {"__version__"}:
        types.setdefault(getattr(eaid, name).__module__, []).append(f"{name} as {name}")
    modules = sorted(FROM.keys() | types.keys())
    imports = "".join(
        f"from {module} import {name}\n" for module in modules
        for name in sorted(FROM.get(module, []) + types.get(module, []), key=str.lower)
    )  # fmt: skip
    return f"{HEAD}{imports}\n" + "\n".join(map(declared, functions))


def declared(function: ast.FunctionDef) -> str:
    """One function, its `**keywords` spelt out."""
    given = function.args
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    defaults = [None] * (len(given.args) - len(given.defaults)) + given.defaults
    rows = [row(one, default) for one, default in zip(given.args, defaults, strict=True)]
    rows.append(f"*{row(given.vararg, None)}" if given.vararg else "*")
    rows += [row(one, default) for one, default in zip(given.kwonlyargs, given.kw_defaults, strict=True)]
    for decorator in function.decorator_list:
        kind = getattr(options, ast.unparse(decorator).partition("(")[2].rstrip(")"))
        rows += [f"{one.name}: {one.taken} = {shown(one.default)}" for one in keywords_of(kind, names)]
    if rows[-1] == "*":
        rows.pop()
    returned = ast.unparse(function.returns).strip("'") if function.returns else "None"
    said = (ast.get_docstring(function) or "").partition("\n")[0]
    if not function.decorator_list and len(text := f"def {function.name}({', '.join(rows)}) -> {returned}:") < 120:
        return f'{text}\n    """{said}"""\n'
    body = "".join(f"    {one},\n" for one in rows)
    return f'def {function.name}(\n{body}) -> {returned}:\n    """{said}"""\n'


def row(one: ast.arg, default: ast.expr | None) -> str:
    """A parameter of the function's own; what is no plain value is `...`."""
    hint = ast.unparse(one.annotation).strip("'") if one.annotation else "Any"
    value = "" if default is None else f" = {ast.unparse(default)}" if isinstance(default, ast.Constant) else " = ..."
    return f"{one.arg}: {hint}{value}".replace("'", '"')


def shown(default: object) -> str:
    """A default, where it is short."""
    text = repr(default).replace("'", '"')
    return text if len(text) < 40 and "(" not in text[1:] else "..."


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
