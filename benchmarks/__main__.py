"""`python -m benchmarks [NAME …]`: run the speed benchmarks and print (and keep) one table."""

import importlib
import sys
from pathlib import Path

from benchmarks.table import Row, machine, markdown

ALL = ("fit_speed", "processes", "reading", "replay_speed")
TABLE = Path(__file__).parent.parent / "bench.md"


def main() -> None:
    names = sys.argv[1:] or ALL
    rows: list[Row] = []
    text = ""
    for name in names:
        print(f"… {name}", file=sys.stderr, flush=True)
        for row in importlib.import_module(f"benchmarks.{name}").rows():
            print(
                f"  {row.what}: {row.ratio} ({row.bar}: {'met' if row.met else 'MISSED'})", file=sys.stderr, flush=True
            )
            rows.append(row)
        text = f"Measured on {machine()}; medians of runs taken in turn.\n\n{markdown(rows)}"
        if not sys.argv[1:]:  # after each part: a run that is broken off leaves what it has
            TABLE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
