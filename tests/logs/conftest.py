"""How the tests of logs read one log: by `eaid.read`, whole, so that every sample of it can be compared."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import eaid
from eaid import EaidError

sys.path.insert(0, str(Path(__file__).parent))  # logs_written


@dataclass(frozen=True)
class Reader:
    """`read(log)` gives the one run of a log, `read.refused(log)` what is said of one that is refused."""

    folder: Path

    def __call__(self, log: Any, name: str = "log_u60_.dat", **options: Any) -> Any:
        (run,) = self.all(log, name, **options)
        return run

    def all(self, log: Any, name: str = "log_u60_.dat", **options: Any) -> tuple[Any, ...]:
        """`log`: bytes or a text, paths, a DataFrame, or DataFrames by name."""
        if isinstance(log, str | bytes):
            (self.folder / name).write_bytes(log.encode() if isinstance(log, str) else log)
            log = self.folder / name
        elif hasattr(log, "columns") and "run" not in log.columns:
            log = {name: log}
        return eaid.read(log, logs_as="recorded", **options).recorded

    def refused(self, log: Any, name: str = "log_u60_.dat", **options: Any) -> list[str]:
        """The sentences, without the path of the log that they begin with."""
        with pytest.raises(EaidError) as caught:
            self.all(log, name, **options)
        where = f"{self.folder / name if isinstance(log, str | bytes) else name}: "
        return [sentence.removeprefix(where) for sentence in caught.value.sentences]


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    return Reader(tmp_path)


@pytest.fixture(scope="session")
def codes() -> Any:
    """Code → values of the findings of a run, without the notes that a plain time counts s and a plain duty %."""
    plain = ({"role": "time", "unit": "s"}, {"role": "input", "unit": "%"})

    def of(run: Any) -> dict[str, Mapping[str, Any]]:
        assert {one.subject for one in run.findings} <= {run.name}
        found = ((one.code, dict(one.values)) for one in run.findings)
        return {code: said for code, said in found if code != "unit-assumed" or
                not any(one.items() <= said.items() for one in plain)}  # fmt: skip

    return of
