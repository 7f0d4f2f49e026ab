"""Options that every command shares, under the same names."""

from pathlib import Path
from typing import Annotated

import typer

Output = Annotated[Path | None, typer.Option("-o", "--output", help="Where the result is written.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result, machine-readable, on stdout.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No messages, tables or progress; errors are still told.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing output.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of everything random; the same seed gives the same bytes.")]
