"""Which logs hold no steps and are fitted whole, and that the command which their refusal names takes them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from eaid.arrays import Array, read_only
from eaid.cli.main import app
from eaid.errors import DataError
from eaid.logs.run import Run
from eaid.reading import InputOptions, steps_of
from eaid.steps.edges import moving

TIME = np.arange(4000) / 100


def inputs() -> dict[str, Array]:
    bits = np.repeat(np.random.default_rng(3).integers(0, 2, 80), 50)
    return {
        "input-is-binary": 30.0 + 40.0 * bits,
        "input-is-binary from rest": 60.0 * bits,
        "input-sweeps": 50 + 30 * np.sin(2 * np.pi * (0.1 * TIME + 1.9 * TIME**2 / 80)),
        "input-is-periodic": 50 + 30 * np.sin(2 * np.pi * 0.5 * TIME),
    }


def recorded(duty: Array) -> Run:
    torque = np.zeros(len(duty))
    for i in range(1, len(duty)):
        torque[i] = torque[i - 1] + 0.01 * (0.03 * duty[i] - torque[i - 1]) / 0.3
    torque += 0.01 * np.random.default_rng(0).normal(size=len(duty))
    return Run(
        name="a", time_s=read_only(TIME), input=read_only(duty), output=read_only(torque), input_unit="%",
        output_unit="N·m", source="a.csv", sha256="0", kind="clutch",
    )  # fmt: skip


@pytest.mark.parametrize("kind", inputs())
def test_they_are_refused_as_steps_and_taken_whole(kind: str) -> None:
    run = recorded(inputs()[kind])
    with pytest.raises(DataError) as refused:
        steps_of([run], InputOptions())
    assert "eaid fit takes such a log whole" in str(refused.value)
    assert steps_of([run], InputOptions(), whole="auto")[1].recorded == (run,)


def test_the_named_command_works(tmp_path: Path) -> None:
    run = recorded(inputs()["input-is-binary from rest"])
    table = np.stack([run.time_s, run.input, run.output], axis=1)
    head = {"delimiter": ",", "comments": "", "header": "time_s,duty_pct,torque_nm"}
    np.savetxt(tmp_path / "a.csv", table, **head)  # type: ignore[arg-type]
    refused = CliRunner().invoke(app, ["ingest", str(tmp_path / "a.csv"), "-o", str(tmp_path / "a.h5")])
    assert isinstance(refused.exception, DataError)
    made = CliRunner().invoke(app, ["fit", str(tmp_path / "a.csv"), "-o", str(tmp_path / "fit.json"), "--ci", "none"])
    assert made.exit_code == 0, made.output


def test_a_friction_rig_is_not_taken_whole() -> None:
    run = replace(recorded(inputs()["input-is-binary"]), kind="friction-force")
    with pytest.raises(DataError):
        steps_of([run], InputOptions(), whole="auto")


def test_turns_at_exactly_even_times() -> None:
    period = np.tile([0.0, 1.0, 2.0, 1.0], 20)
    assert moving("a", np.arange(80.0), np.repeat(period, 1)).code in ("input-is-periodic", "input-reverses")
