"""How to make the same files again: the command lines that made them."""

import shlex

from eaid.report.results import Results


def commands(results: Results) -> list[str]:
    """Command lines that make these files again; a result of the Python API says so."""
    made = [("fit", one.path, one.result.command) for one in results.fits]
    made += [("tune-rc", one.path, one.result.command) for one in results.gains]
    made += [("simulate", one.path, one.result.head.command) for one in results.replays]
    made += [("couple", one.path, one.result.command) for one in results.couplings]
    lines = [f"eaid ingest LOGS -o {shlex.quote(data.path)}" for data in results.data]
    for name, path, words in made:
        line = shlex.join(["eaid", name, *words, "-o", path])
        lines.append(line if words else f"{path}: made in Python by eaid.{name.replace('-', '_')}")
    sources = (source.path for source in results.sources)
    return [*lines, shlex.join(["eaid", "report", *sources, "-o", "report"])]
