"""dataset.toml says all once; logs of one run are joined by time."""

from pathlib import Path

import numpy as np
import pytest

from eaid.cli.console import be_quiet
from eaid.cli.inputs import runs_from
from eaid.cli.main import run
from eaid.reading import InputOptions

T = np.arange(1000) / 100.0


def write(path: Path, level: float, header: str = "Zeit,Kraft", seed: int = 0) -> Path:
    """A log without an input column: the step at 2 s, the release at 7 s."""
    y = np.where(T >= 2, 0.02 * level * -np.expm1(-np.maximum(T - 2, 0) / 0.3), 0) * np.where(
        T >= 7, np.exp(-np.maximum(T - 7, 0) / 0.5), 1
    )
    y = y + 0.005 * np.random.default_rng(seed).normal(size=len(T)) + 0.1
    lines = [header, *(f"{a:.2f},{b:.6f}" for a, b in zip(T, y, strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path


ODD = [
    "--columns", "time=Zeit,output=Kraft", "--units", "output=N,input=V", "--name-pattern", "_V={level}_n{repeat}",
    "--step-at", "2", "--until", "7", "--apparatus", "surfaces=1",
]  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "logs"
    made.mkdir()
    for level in (100, 200, 300):
        for repeat in (1, 2):
            write(made / f"x_V={level}_n{repeat}.csv", level, seed=level + repeat)
    return made


def test_the_next_call_needs_no_options(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ingest", str(folder), *ODD, "--write-manifest", "-o", str(tmp_path / "a.h5")]) == 0
    assert f"{folder / 'dataset.toml'}: written; eaid ingest {folder} needs no options now" in capsys.readouterr().err
    for given in (folder, folder / "dataset.toml"):
        assert run(["ingest", str(given), "-q", "--force", "-o", str(tmp_path / "b.h5")]) == 0
        assert (tmp_path / "b.h5").read_bytes() == (tmp_path / "a.h5").read_bytes()
    written = (folder / "dataset.toml").read_text()
    assert [written.count(f"level = {level}.0") for level in (100, 200, 300)] == [2, 2, 2]
    stepset = runs_from([folder])[1]
    assert [level.level for level in stepset.levels] == [100.0, 200.0, 300.0]
    assert [level.level for level in stepset.releases] == [100.0, 200.0, 300.0]
    assert (stepset.input_unit, stepset.output_unit, stepset.apparatus.surfaces) == ("V", "N", 1)


def test_it_is_not_overwritten(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "dataset.toml").write_text("mine")
    assert (
        run(["ingest", str(folder / "x_V=100_n1.csv"), *ODD, "-q", "--write-manifest", "-o", str(tmp_path / "a.h5")])
        == 2
    )
    assert "dataset.toml: exists already; give --force to overwrite it" in capsys.readouterr().err
    assert (folder / "dataset.toml").read_text() == "mine"
    assert not (tmp_path / "a.h5").exists()


def test_options_typed_win_and_what_changed_is_told(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["ingest", str(folder), *ODD, "-q", "--write-manifest", "-o", str(tmp_path / "a.h5")]) == 0
    write(folder / "later_V=400_n1.csv", 400)
    write(folder / "x_V=100_n1.csv", 100, seed=99)
    be_quiet(False)
    steps, stepset = runs_from([folder], InputOptions(levels="100,300"))
    assert [level.level for level in stepset.levels] == [100.0, 300.0]
    assert "does not list later_V=400_n1.csv, which is left out" in capsys.readouterr().err
    told = {step.name: {one.code for one in step.findings} for step in steps}
    assert "log-changed" in told["x_V=100_n1"]
    assert "log-changed" not in told["x_V=100_n2"]


def test_levels_and_steps_of_single_logs(tmp_path: Path) -> None:
    write(tmp_path / "a.csv", 150, "time_s,torque_nm")
    write(tmp_path / "b.csv", 250, "time_s,torque_nm", seed=4)
    (tmp_path / "dataset.toml").write_text(
        'schema = "eaid/manifest/1"\n[options]\nunits = "input=V"\n'
        '[[log]]\nfile = "a.csv"\nlevel = 150\nstep_s = 2.0\nuntil_s = 7.0\n'
        '[[log]]\nfile = "b.csv"\nlevel = 250.0\nrepeat = 3\n'
    )
    stepset = runs_from([tmp_path])[1]
    assert [level.level for level in stepset.levels] == [150.0, 250.0]
    found = {r.name: (r.step_s, r.repeat) for r in stepset.runs}
    assert found["a"] == (2.0, 1)
    assert found["a-release"] == (7.0, 1)
    assert found["b"][0] == pytest.approx(2.0, abs=0.05)  # found from the output
    assert found["b"][1] == 3


BAD = [
    ("x = [", "is no TOML (", 3),
    ('schema = "other"', "its schema is 'other', and this eaid reads 'eaid/manifest/1'; write it again with", 3),
    ("[options]", "lists no logs; write it again with --write-manifest of eaid ingest", 3),
    (
        '[options]\nfoo = 1\n[[log]]\nfile = "a.csv"',
        "Object contains unknown field `foo` - at `options`; mend it",
        3,
    ),
    (
        '[options]\nrest = "x"\n[[log]]\nfile = "a.csv"',
        "Expected `float | null`, got `str` - at `options.rest`",
        3,
    ),
    ('[options]\nrepair = 1\n[[log]]\nfile = "a.csv"', "Expected `bool`, got `int` - at `options.repair`", 3),
    ("[[log]]\nlevel = 3", "Object missing required field `file` - at `log[0]`", 3),
    ('[[log]]\nfile = "a.csv"\nfoo = 1', "Object contains unknown field `foo` - at `log[0]`", 3),
    ('[[log]]\nfile = "a.csv"\nlevel = "3"', "Expected `float | null`, got `str` - at `log[0].level`", 3),
    *(
        (f'[[log]]\nfile = "a.csv"\n{name} = {value}', f"Expected `{limit} - at `log[0].{name}`; mend it", 3)
        for name, value, limit in (
            ("level", "nan", "float` >= -1000000000000.0"),
            ("level", "-inf", "float` >= -1000000000000.0"),
            ("level", 10**30, "float` <= 1000000000000.0"),
            ("step_s", "nan", "float` >= -1000000000000.0"),
            ("until_s", "inf", "float` <= 1000000000000.0"),
            ("repeat", -1, "int` >= 0"),
            ("repeat", 2**63, "int` <= 9223372036854775807"),
        )
    ),
    *(
        (f'[[log]]\nfile = "a.csv"\n{line}', f"{said}; write it again with --write-manifest of eaid ingest", 3)
        for line, said in (
            ("x = " + 1000 * "[" + 1000 * "]", "is nested too deep"),
            ("x = " + 1000 * "[\n" + 1000 * "]\n", "is nested too deep"),
            ("x = " + 600 * "{a=" + "1" + 600 * "}", "is nested too deep"),
            (20_000 * "a." + "a = 1", "has a line of more than 4,000 characters"),
            (f"x = {5000 * '9'}", "has a line of more than 4,000 characters"),
        )
    ),
    ('[options]\nrest = nan\n[[log]]\nfile = "a.csv"', "--rest nan: give a number from -1e+09 to 1e+09", 2),
    ('[options]\nrate_hz = nan\n[[log]]\nfile = "a.csv"', "--rate-hz nan: must be above zero", 2),
    ('[[log]]\nfile = "gone.csv"', "its log gone.csv is not there; put it back or take it off", 3),
]


@pytest.mark.parametrize(("text", "sentence", "code"), BAD)
def test_bad_manifests(text: str, sentence: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "dataset.toml"
    write(tmp_path / "a.csv", 100)
    path.write_text(text if text.startswith(("x", "schema")) else f'schema = "eaid/manifest/1"\n{text}\n')
    assert run(["ingest", str(tmp_path), "-q", "-o", str(tmp_path / "d.h5")]) == code
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"error: {sentence}" if code == 2 else f"error: {path}: {sentence}")


def test_a_manifest_comes_alone(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "dataset.toml").write_text('schema = "eaid/manifest/1"')
    assert run(["ingest", str(folder), str(write(tmp_path / "a.csv", 10)), "-o", str(tmp_path / "d.h5")]) == 2
    assert "says all about its own logs; give it, or its folder, alone" in capsys.readouterr().err


def parts(folder: Path, bounds: list[int], anew: bool = False) -> list[Path]:
    u = np.where((T >= 2) & (T < 7), 50.0, 0.0)
    y = np.where(T >= 2, 2 * -np.expm1(-np.maximum(T - 2, 0) / 0.3), 0.0)
    written = []
    for k, (a, b) in enumerate(zip([0, *bounds], [*bounds, len(T)], strict=True), start=1):
        t = T[a:b] - (T[a] if anew else 0)
        lines = [
            "time_s,duty_pct,torque_nm",
            *(f"{i!r},{j!r},{m!r}" for i, j, m in zip(t.tolist(), u[a:b].tolist(), y[a:b].tolist(), strict=True)),
        ]
        path = folder / f"run_part{k}.csv"
        path.write_text("\n".join(lines) + "\n")
        written.append(path)
    return written


def test_logs_of_one_run_are_joined_by_time(tmp_path: Path) -> None:
    files = parts(tmp_path, [150, 400, 800])
    steps, stepset = runs_from(files[::-1], InputOptions(join=True))
    assert [(s.name, s.level, s.step_s, s.edge) for s in steps] == [
        ("run", 50.0, 2.0, "rising"),
        ("run-release", 50.0, 7.0, "falling"),
    ]
    assert stepset.levels[0].runs.shape == (1, 500)
    (said,) = [one for one in steps[0].findings if one.code == "logs-joined"]
    assert str(said.values["others"]).startswith(f"{files[1]} (")


def test_logs_whose_clocks_begin_anew_cannot_be_joined(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = parts(tmp_path, [150], anew=True)
    assert run(["ingest", *map(str, files), "--join", "-q", "-o", str(tmp_path / "d.h5")]) == 3
    assert capsys.readouterr().err == (
        f"error: {files[1]}: begins at 0 s, before {files[0]} ends (1.49 s); each begins its clock anew; "
        f"logs of one run must follow each other in time to be joined\n"
    )


def test_parts_by_level_in_their_names(tmp_path: Path) -> None:
    for level in (40, 80):
        for part, rows in (("a", slice(0, 500)), ("b", slice(500, 1000))):
            y = 0.02 * level * np.where(T >= 2, -np.expm1(-np.maximum(T - 2, 0) / 0.3), 0.0)
            lines = [
                "time_s,torque_nm",
                *(f"{i!r},{m!r}" for i, m in zip(T[rows].tolist(), y[rows].tolist(), strict=True)),
            ]
            (tmp_path / f"u{level}_{part}.csv").write_text("\n".join(lines) + "\n")
    stepset = runs_from([tmp_path], InputOptions(join=True, name_pattern="u{level}_", step_at=2.0))[1]
    assert [(level.level, len(level.time_s)) for level in stepset.levels] == [(40.0, 800), (80.0, 800)]


def test_a_manifest_freezes_no_instant_that_was_found(tmp_path: Path) -> None:
    """An instant that the output told may be wrong; only what the user says is kept."""
    write(tmp_path / "x_V=100_n1.csv", 100)
    options = ["--columns", "time=Zeit,output=Kraft", "--name-pattern", "_V={level}_n{repeat}", "--units", "output=N"]
    assert run(["ingest", str(tmp_path), *options, "-q", "--write-manifest", "-o", str(tmp_path / "d.h5")]) == 0
    assert "step_s" not in (tmp_path / "dataset.toml").read_text()
    assert "level = 100.0" in (tmp_path / "dataset.toml").read_text()
