"""What a log looks like that holds no single step."""

from eaid.errors import DataError
from eaid.logs.run import Run


def refuse_to_cut(run: Run) -> DataError:
    """Why a log whose input never stands still holds no steps."""
    return DataError(f"{run.where}: the input moves most of the time, so it holds no steps; record one level at a time")
