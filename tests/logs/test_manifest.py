"""dataset.toml: what was said of a folder of logs is kept beside them, read again, and refused where it is bad."""

from pathlib import Path

import numpy as np
import pytest
from logs_written import text

import eaid

T = np.arange(1000) / 100.0
RISE = -np.expm1(-np.maximum(T - 2, 0) / 0.3)
Y = np.where(T >= 7, RISE * np.exp(-np.maximum(T - 7, 0) / 0.5), RISE) + 0.1

ODD = {"--columns": "time=Zeit,output=Kraft", "--units": "output=N,input=V", "--name-pattern": "_V={level}_n{repeat}",
       "--step-at": "2", "--until": "7", "--apparatus": "surfaces=1"}  # fmt: skip
SAYS = [word for pair in ODD.items() for word in pair]
MANIFEST = 'schema = "eaid/manifest/1"\n'


def odd_log(path: Path, level: float, more: float = 0.0) -> Path:
    noise = 0.005 * np.random.default_rng(round(level + 1000 * more)).normal(size=1000)
    path.write_text(text("Zeit,Kraft", T, np.round(0.02 * level * (Y - 0.1) + 0.1 + noise + more, 6)))
    return path


@pytest.fixture
def odd_logs(tmp_path):
    made = tmp_path / "logs"
    made.mkdir()
    for level in (100, 200):
        for repeat in (1, 2):
            odd_log(made / f"x_V={level}_n{repeat}.csv", level, repeat / 1000)
    return made


def test_the_next_call_needs_no_options(odd_logs, tmp_path, run_eaid):
    out = tmp_path / "a.h5"
    ran = run_eaid("ingest", odd_logs, *SAYS, "--write-manifest", "-o", out)
    assert f"{odd_logs / 'dataset.toml'}: written; eaid ingest {odd_logs} needs no options now" in ran.err
    for given in (odd_logs, odd_logs / "dataset.toml"):
        assert run_eaid("ingest", given, "-q", "--force", "-o", tmp_path / "b.h5").code == 0
        assert (tmp_path / "b.h5").read_bytes() == out.read_bytes()
    written = (odd_logs / "dataset.toml").read_text()
    assert [written.count(f"level = {level}.0") for level in (100, 200)] == [2, 2] and "step_s" not in written
    steps = eaid.read(odd_logs)
    assert [one.level for one in (*steps.levels, *steps.releases)] == [100.0, 200.0] * 2
    assert (steps.input_unit, steps.output_unit, steps.apparatus.surfaces) == ("V", "N", 1)
    # so are some of its logs, by name; one that it does not list stands for itself
    some = [odd_logs / "x_V=200_n1.csv", odd_logs / "x_V=200_n2.csv"]
    assert [(one.level, len(one.names)) for one in eaid.read(some).levels] == [(200.0, 2)]
    with pytest.raises(eaid.DataError, match="several steps"):
        eaid.read([*some, odd_log(odd_logs / "other.csv", 300)])
    (odd_logs / "other.csv").unlink()
    # options that are typed win; what came later, or was changed since, is told
    odd_log(odd_logs / "later_V=400_n1.csv", 400)
    odd_log(odd_logs / "x_V=100_n1.csv", 100, 0.01)
    ran = run_eaid("ingest", odd_logs, "--levels", "100", "--force", "-o", out)
    assert f"{odd_logs / 'dataset.toml'}: does not list later_V=400_n1.csv, which is left out" in ran.err
    changed = {run.name for run in eaid.read(out).runs if "log-changed" in [one.code for one in run.findings]}
    assert changed == {"x_V=100_n1"}
    # nothing is overwritten, and a manifest comes alone
    ran = run_eaid("ingest", odd_logs / "x_V=100_n1.csv", *SAYS, "-q", "--write-manifest", "-o", tmp_path / "c.h5")
    assert ran.code == 2 and "dataset.toml: exists already; give --force to overwrite it" in ran.err
    ran = run_eaid("ingest", odd_logs, odd_log(tmp_path / "a.csv", 10), "-o", tmp_path / "c.h5")
    assert ran.code == 2 and "says all about its own logs; give it, or its folder, alone" in ran.err
    there = odd_log(tmp_path / "x_V=10_n1.csv", 10)
    ran = run_eaid(
        "ingest", there, odd_logs / "x_V=100_n2.csv", *SAYS, "-q", "--write-manifest", "-o", tmp_path / "c.h5"
    )
    assert ran.err == "error: --write-manifest: the logs lie in several folders; put them into one\n"
    assert ran.code == 2 and not (tmp_path / "c.h5").exists()


def test_levels_steps_and_repeats_of_single_logs(tmp_path):
    for name, level in (("a", 150), ("b", 250)):
        odd_log(tmp_path / f"{name}.csv", level)
    (tmp_path / "dataset.toml").write_bytes(
        b"\xef\xbb\xbf" + (MANIFEST + '[options]\nunits = "input=V,output=N"\ncolumns = "time=1,output=2"\n'
                           '[[log]]\nfile = "a.csv"\nlevel = 150\nstep_s = 2.0\nuntil_s = 7.0\n'
                           '[[log]]\nfile = "b.csv"\nlevel = 250.0\nrepeat = 3\n').encode()
    )  # fmt: skip
    steps = eaid.read(tmp_path)
    assert [run.level for run in steps.runs] == [150.0, 150.0, 250.0]
    found = {run.name: (run.step_s, run.repeat) for run in steps.runs}
    assert (found["a"], found["a-release"]) == ((2.0, 1), (7.0, 1))
    assert (found["b"][0], found["b"][1]) == (pytest.approx(2.0, abs=0.05), 3)  # the instant told by the output


BAD = {
    "x = [": "is no TOML (", 'schema = "other"': "its schema is 'other', and this eaid reads 'eaid/manifest/1'; write",
    "[options]": "lists no logs; write it again with --write-manifest of eaid ingest",
    '[options]\nfoo = 1\n[[log]]\nfile = "a.csv"': "Object contains unknown field `foo` - at `options`; mend it",
    '[options]\nrest = "x"\n[[log]]\nfile = "a.csv"': "Expected `float | null`, got `str` - at `options.rest`",
    "[[log]]\nlevel = 3": "Object missing required field `file` - at `log[0]`",
    '[[log]]\nfile = "a.csv"\nlevel = "3"': "Expected `float | null`, got `str` - at `log[0].level`",
    '[[log]]\nfile = "a.csv"\nlevel = nan': "Expected `float` >= -1000000000000.0 - at `log[0].level`; mend it",
    f"x = '{3994 * 'a'}'": "lists no logs",
    '[options]\nrest = nan\n[[log]]\nfile = "a.csv"': "--rest nan: give a number from -1e+12 to 1e+12",
    '[[log]]\nfile = "../a.csv"': "its log ../a.csv lies outside its folder; put it there",
    '[[log]]\nfile = "/a/b.csv"': "its log /a/b.csv lies outside its folder; put it there",
    '[[log]]\nfile = "gone.csv"': "its log gone.csv is not there; put it back or take it off",
}  # fmt: skip


@pytest.mark.parametrize("content", BAD, ids=[said[:30] for said in BAD.values()])
def test_bad_manifests(content, tmp_path, run_eaid):
    path, sentence = tmp_path / "dataset.toml", BAD[content]
    odd_log(tmp_path / "a.csv", 100)
    path.write_text(content if content.startswith(("x = [", "schema")) else MANIFEST + content)
    ran = run_eaid("ingest", tmp_path, "-q", "-o", tmp_path / "d.h5")
    of_option = sentence.startswith("--")
    assert ran.code == (2 if of_option else 3) and len(ran.err.splitlines()) == 1
    assert ran.err.startswith(f"error: {sentence}" if of_option else f"error: {path}: {sentence}")


def test_a_log_that_is_excluded_says_why(odd_logs, tmp_path, run_eaid):
    assert run_eaid("ingest", odd_logs, *SAYS, "-q", "--write-manifest", "-o", tmp_path / "a.h5").code == 0
    path = odd_logs / "dataset.toml"
    file = 'file = "x_V=100_n1.csv"'
    path.write_text(path.read_text().replace(file, f'{file}\nexclude = "belt slipped"'))
    ran = run_eaid("ingest", odd_logs, "-o", tmp_path / "b.h5")
    assert f"warning: {path}: 1 of 4 logs excluded (x_V=100_n1.csv: belt slipped)" in ran.err.splitlines()
    assert [len(level.names) for level in eaid.read(tmp_path / "b.h5").levels] == [1, 2]
    path.write_text(
        path.read_text().replace("file =", 'exclude = "x"\nfile =').replace('\nexclude = "belt slipped"', "")
    )
    ran = run_eaid("ingest", odd_logs, "-o", tmp_path / "c.h5")
    assert ran.code == 3 and ran.err.endswith("excludes all its logs; take exclude off one\n")
