"""Tables of replays, as page and terminal show them."""

import msgspec
import numpy as np

from eaid.report.tables import replays
from eaid.results.replay import Distribution, Head, Metrics, PlantSpread, Record, Replay, StepMetrics, Worst

COLUMNS = {
    "time_s": np.arange(3.0), "reference_nm": np.ones(3), "torque_nm": np.array([0.0, 0.5, 0.75]),
    "duty_pct": np.zeros(3),
}  # fmt: skip
RC = Metrics(
    rms_error_nm=0.3, iae_nm_s=0.9, guarantee_holds_fraction=0.75,
    guarantee_largest_chi_over_rho=1.5, guarantee_failures_at_limit=1.0, guarantee_failures_by_saturation=0.5,
    steps=(StepMetrics(0.0, 1.0, 0.1, 2.0, None, 0.3),),
)  # fmt: skip


STEPS = Head("steps")


def made(head=STEPS, **records) -> Replay:
    return Replay(head, {name.replace("_", "-"): Record(COLUMNS, *given) for name, given in records.items()})


def rows_of(table) -> list[tuple[str, ...]]:
    return list(table.texts)


def test_an_error_that_the_file_does_not_say_is_that_of_the_trace():
    table = replays.errors_table([made(rc=(RC,), other=(Metrics(),))])
    rc, other = rows_of(table)
    assert rc[:2] == ("steps", "RC") and other[1] == "other"
    assert rc[2] == "1.00" and rc[4] == f"{1.75 / 3:.3f}" and rc[5] == "0.900"
    assert dict(zip(table.heads, rc, strict=True))["∫ |error| (N·m·s)"] == "0.900"


def test_the_guarantee_in_percent_and_a_dash_where_nothing_failed():
    whole = msgspec.structs.replace(
        RC, guarantee_holds_fraction=1.0, guarantee_failures_at_limit=None, guarantee_failures_by_saturation=None
    )
    assert rows_of(replays.guarantee_table(made(rc=(RC,))))[0] == ("RC", "75.00", "1.50", "100", "50.0")
    assert rows_of(replays.guarantee_table(made(rc=(whole,))))[0][3:] == ("–", "–")
    assert replays.guarantee_table(made(pi=(Metrics(),))).rows == ()


def test_drawn_plants_have_a_row_a_number_and_the_worst_plant_is_told():
    drawn = {
        "max_abs_error_nm": Distribution(Worst(0.5, 7, (0.1,), (4.0,), (2.0,)), low=0.1, median=0.2, high=0.4),
        "steps[1].settling_s": Distribution(Worst(None, 3), low=0.1, median=0.2, high=0.4, never=2),
    }
    head = Head("steps", plants=9)
    table = replays.plants_table(made(head, rc=(Metrics(plants=PlantSpread(9, drawn)),)))
    assert rows_of(table) == [
        ("RC: largest |error| (N·m)", "0.100", "0.200", "0.400", "0.500", "7", "0"),
        ("RC: steps[1].settling_s", "0.100", "0.200", "0.400", "–", "3", "2"),
    ]
    assert "9 plants" in table.caption and "RC on plant 7: τ1 [0.1000], τ2 [4.000], T_s [2.000]" in table.caption


def test_a_step_has_both_settling_times():
    assert rows_of(replays.steps_table(made(rc=(RC,))))[0] == ("RC", "0 → 1", "0.100", "2.00", "–", "0.300")


def test_tables_without_rows_are_left_out():
    shown = [table.heading for table in replays.tables_of(made(rc=(RC,)))]
    assert shown == ["Errors of each controller", "Each step", "Guarantee along this replay"]
