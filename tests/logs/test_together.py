"""What several logs are together, at the edges of each rule: levels in names, scales, copies, names, parts of a run."""

from dataclasses import replace

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.read import columns_told, counted_once, joined, levels_in_names, named_apart, scales_compared, together
from eaid.logs.run import Run

N = 200
T = read_only(np.arange(N) / 100.0)
ON = np.where(T >= 1, 1.0, 0.0)


def run(name: str, u: np.ndarray = ON, y: np.ndarray = ON, **more: object) -> Run:
    one = Run(name, T, read_only(u), read_only(y), "%", "N·m", f"logs/{name}.csv", name)
    return replace(one, **{"taken": (("time", "t"), ("input", "x"), ("output", "y")), **more})  # type: ignore[arg-type]


GUESSED = (finding("input-unnamed", "log", column="x"),)


def switched(name: str, swing: float, **more: object) -> Run:
    return run(name, y=swing * ON, **{"findings": GUESSED, **more})  # type: ignore[arg-type]


def test_logs_of_on_and_off_whose_names_differ_are_refused_by_the_first() -> None:
    other = (("time", "t"), ("input", "z"), ("output", "y"))
    runs = [
        run("note", 60 * ON),
        switched("t_10V_1", 1.0),
        switched("t_20V_1", 2.0, taken=other),
        switched("t_20V_2", 2),
    ]
    with pytest.raises(DataError) as fault:
        levels_in_names(runs)
    said = fault.value.sentences[0]
    assert said.startswith("logs/t_10V_1.csv and 2 more: x says only on or off, and the names of the logs differ in a")
    assert 'name_pattern» "t_{level}V_"' in said and said.endswith('«columns» input="x"')


@pytest.mark.parametrize(
    ("swings", "more", "refused"),
    [
        ((1.0, 1.5), {}, True),  # the ratio itself
        ((1.5, 1.0), {}, True),
        ((1.0, 1.49), {}, False),  # repeats that differ
        ((1.0, 2.0), {"findings": (finding("input-by-its-steps", "log", column="x", still="u"),)}, True),
        ((1.0, 2.0), {"findings": (finding("columns-by-place", "log", order=""),)}, False),  # nobody guessed
        ((1.0, 2.0), {"findings": ()}, False),
        ((1.0, 2.0), {"level": 5.0}, False),
        ((1.0, 2.0), {"dataset": "d.h5"}, False),
        ((1.0, 2.0), {"input": read_only(2 * ON)}, False),  # a number of its own
        ((1.0, 2.0), {"input": read_only(np.ones(N))}, True),  # on all the time
        ((2.0,), {}, False),
    ],
)
def test_what_says_only_on_or_off(swings: tuple[float, ...], more: dict[str, object], refused: bool) -> None:
    runs = [switched(f"t_{10 + k}V", swing, **more) for k, swing in enumerate(swings)]
    if refused:
        with pytest.raises(DataError):
            levels_in_names(runs)
    else:
        levels_in_names(runs)


def test_peaks_of_a_few_samples_are_no_swing() -> None:
    """Three of 200 samples: the outer 2 % at either end do not count."""
    peaked = ON + np.where(np.arange(N) >= N - 3, 5.0, 0.0) - np.where(np.arange(N) < 3, 5.0, 0.0)
    levels_in_names([switched("t_10V", 1.0), switched("t_20V", 1.0, output=read_only(peaked))])
    wide = ON + np.where(np.arange(N) >= N - 6, 5.0, 0.0)
    with pytest.raises(DataError):
        levels_in_names([switched("t_10V", 1.0), switched("t_20V", 1.0, output=read_only(wide))])


@pytest.mark.parametrize(
    ("tops", "told"),
    [
        ((0.5, 50.0), {0: 50.0}), ((-0.5, -50.0), {0: 50.0}), ((0.5, 1.5), {}), ((0.5, 1.6), {0: 1.6}),
        ((1.0, 100.0), {0: 100.0}), ((1.0, 99.0), {}), ((1.0, 99.9996), {0: 99.9996}), ((1.1, 100.0), {}),
        ((0.0, 100.0), {}), ((0.5, 1.0), {}), ((0.5, 40.0, 100.0, 1.0), {0: 100.0, 3: 100.0}),
    ],
)  # fmt: skip
def test_fractions_among_percent(tops: tuple[float, ...], told: dict[int, float]) -> None:
    found = scales_compared([run(f"r{k}", top * ON) for k, top in enumerate(tops)])
    said = {k: one.findings[0].values["other"] for k, one in enumerate(found) if one.findings}
    assert said == pytest.approx(told)
    assert all(one.findings[0].code == "input-in-fractions" for k, one in enumerate(found) if k in told)


def test_only_inputs_in_percent_are_compared() -> None:
    for other in ({"input_unit": "V"}, {"dataset": "d.h5"}, {"input": np.empty(0)}):
        alone = scales_compared([run("a", 0.5 * ON), run("b", 50 * ON, **other)])  # type: ignore[arg-type]
        assert [one.findings for one in alone] == [(), ()]
    third = scales_compared([run("a", 0.5 * ON), run("v", 0.1 * ON, input_unit="V"), run("b", 50 * ON)])
    assert [len(one.findings) for one in third] == [1, 0, 0]
    assert together([run("a", 0.5 * ON), run("b", 50 * ON)], [], ReadOptions(units={"input": "%"}))[0][0].findings == ()
    assert together([run("a", 0.5 * ON), run("b", 50 * ON)], [], ReadOptions(units={"output": "N"}))[0][0].findings


def test_a_log_that_comes_again_counts_once_and_the_first_says_so() -> None:
    first, copy = run("a"), run("b", sha256="a")
    kept = counted_once([run("x"), first, copy, replace(copy, source="logs/c.csv")])
    assert [one.name for one in kept] == ["x", "a"] and kept[0].findings == ()
    (said,) = kept[1].findings
    assert (said.code, said.subject) == ("log-given-twice", "a")
    assert said.values == {"path": "logs/b.csv, logs/c.csv", "first": "logs/a.csv"}
    # steps of one log in one dataset are no copies; a log without a fingerprint has none
    assert len(counted_once([replace(first, dataset="d.h5"), replace(copy, dataset="d.h5")])) == 2
    assert len(counted_once([run("a", sha256=""), run("b", sha256="")])) == 2
    (one,) = counted_once([replace(first, dataset="d.h5"), copy])
    assert one.findings[0].values == {"path": "logs/b.csv", "first": "d.h5"}


def test_equal_names_get_the_folder_and_then_a_number() -> None:
    runs = [run("a", source=f"{folder}/a.csv") for folder in ("x", "y", "y", "y")] + [run("b")]
    assert [one.name for one in named_apart(runs)] == ["x-a", "y-a", "y-a-2", "y-a-3", "b"]


def test_columns_are_told_once_for_all_logs_that_are_alike() -> None:
    reference = run("c", taken=(("time", "t"), ("output", "y"), ("reference", "r")), left=("n", "m"))
    position = run("d", output_unit="", position_unit="mm", taken=(("output", "y"), ("position", "p")))
    assert columns_told([run("a"), reference, run("b"), run("e", taken=()), position]) == [
        "columns of 2 logs: time = t [s], input = x [%], output = y [N·m]; left: none",
        "columns of 1 log: time = t [s], output = y [N·m], reference = r [?]; left: n, m",
        "columns of 1 log: output = y [?], position = p [mm]; left: none",
    ]


def part(name: str, start_s: float, **more: object) -> Run:
    return run(name, start_s=start_s, **more)  # type: ignore[arg-type]


END = float(T[-1])


def test_parts_of_one_run_are_joined_level_by_level_in_time() -> None:
    again = (finding("time-since-1970", "x", column="t", unit="ms"),)
    own = (finding("unit-unknown", "x", role="output", column="y"),)
    runs = [part("b2", 5.0, findings=(*again, *own)), part("b1", 2.0, findings=again), part("c", 0.0, level=3.0)]
    whole, other = joined(runs)
    assert (whole.name, whole.start_s, other.name) == ("b", 2.0, "c")
    np.testing.assert_allclose(whole.time_s, np.concatenate([T, T + 3.0]), atol=1e-12)
    np.testing.assert_array_equal(whole.output, np.concatenate([ON, ON]))
    assert [one.code for one in whole.findings] == ["time-since-1970", "unit-unknown", "logs-joined"]
    assert whole.findings[-1].values == {"others": "logs/b2.csv (b2)"}
    assert len(joined([part("a", 0.0, repeat=1), part("b", 5.0, repeat=2)])) == 2


@pytest.mark.parametrize(
    ("name", "joined_name"),
    [("log_part01", "log"), ("log-1", "log"), ("log.part.1", "log"), ("log 001", "log"), ("log_2", "log_2"),
     ("log11", "log11"), ("u=101", "u=101"), ("1", "1"), ("part1", "part1")],
)  # fmt: skip
def test_the_name_of_the_whole(name: str, joined_name: str) -> None:
    assert joined([part(name, 0.0), part("z", 9.0)])[0].name == joined_name


def test_parts_that_overlap_or_differ_are_refused() -> None:
    with pytest.raises(DataError, match=r"begins at 1\.5 s, before logs/a\.csv ends \(1\.99 s\); logs of one run"):
        joined([part("a", 0.0), part("b", 1.5)])
    with pytest.raises(DataError, match=r"logs/b\.csv: begins at 4 s, .*; each begins its clock anew; logs of"):
        joined([part("a", 4.0), part("b", 4.0)])
    for what, unit in (("input unit", {"input_unit": "V"}), ("output unit", {"output_unit": "N"})):
        with pytest.raises(DataError, match=f"logs/b.csv: its {what} is not that of logs/a.csv"):
            joined([part("a", 0.0), part("b", 5.0, **unit)])


def test_a_reference_is_joined_where_all_parts_have_one() -> None:
    (both,) = joined([part("a", 0.0, reference_nm=T, position=T), part("b", 5.0, reference_nm=ON)])
    assert both.reference_nm is not None and both.reference_nm.tolist() == [*T, *ON]
    assert both.position is None


def test_logs_with_faults_are_neither_joined_nor_refused_again() -> None:
    overlapping = [part("a", 0.0), part("b", 1.0)]
    assert together(overlapping, [], ReadOptions(join=True))[0] == []
    assert "must follow each other" in together(overlapping, [], ReadOptions(join=True))[1][0]
    found, faults = together(overlapping, ["c.csv: is empty"], ReadOptions(join=True))
    assert ([one.name for one in found], faults) == (["a", "b"], ["c.csv: is empty"])
