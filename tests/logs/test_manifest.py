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
MANIFEST = 'schema = "eaid/manifest/2"\n'


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
    steps = eaid.read(odd_logs)
    assert [one.level for one in (*steps.levels, *steps.releases)] == [100.0, 200.0] * 2
    assert (steps.input_unit, steps.output_unit, steps.apparatus.surfaces) == ("V", "N", 1)
    # so are some of its logs, by name; options that are typed win; a dataset beside them says all itself
    some = [odd_logs / "x_V=200_n1.csv", odd_logs / "x_V=200_n2.csv"]
    assert [(one.level, len(one.names)) for one in eaid.read(some).levels] == [(200.0, 2)]
    assert [one.level for one in eaid.read(odd_logs, levels="100").levels] == [100.0]
    out.rename(odd_logs / "a.h5")
    assert len(eaid.read(odd_logs / "a.h5").levels) == 2
    # nothing is overwritten, and a manifest comes alone
    ran = run_eaid("ingest", odd_logs / "x_V=100_n1.csv", "-q", "--write-manifest", "-o", tmp_path / "c.h5")
    assert ran.code == 2 and "dataset.toml: exists already; give --force to overwrite it" in ran.err
    there = odd_log(tmp_path / "x_V=10_n1.csv", 10)
    ran = run_eaid("ingest", odd_logs, there, "-o", tmp_path / "c.h5")
    assert ran.code == 2 and "says all about its own logs; give it, or its folder, alone" in ran.err
    ran = run_eaid("ingest", there, some[0], *SAYS, "-q", "--write-manifest", "-o", tmp_path / "c.h5")
    assert ran.err == "error: --write-manifest: the logs lie in several folders; put them into one\n"
    assert ran.code == 2 and not (tmp_path / "c.h5").exists()


BAD = {
    "x = [": "is no TOML (", 'schema = "other"': "its schema is 'other', and this eaid reads 'eaid/manifest/2'; write",
    "[options]\nfoo = 1": "no such option foo: must be one of", '[options]\nrest = "x"': "--rest 'x': is no number",
    "[options]\nrest = nan": "--rest nan: give a number from -1e+12 to 1e+12",
    "[[log]]\nlevel = 3": "Object contains unknown field `log`; mend it, or write it again",
    "[options]\nrest = [1]": "Expected `bool | float | str`, got `array` - at `options[...]`",
    '[exclude]\n"gone.csv" = ""': "its log gone.csv is not there; put it back or take it off",
    '[exclude]\n"a.csv" = ""': "excludes all its logs; take exclude off one",
}  # fmt: skip


@pytest.mark.parametrize("content", BAD, ids=[said[:30] for said in BAD.values()])
def test_bad_manifests(content, tmp_path, run_eaid):
    path, sentence = tmp_path / "dataset.toml", BAD[content]
    odd_log(tmp_path / "a.csv", 100)
    path.write_text(content if content.startswith(("x = [", "schema")) else MANIFEST + content)
    ran = run_eaid("ingest", tmp_path, "-q", "-o", tmp_path / "d.h5")
    of_option = sentence.startswith(("--", "no such"))
    assert ran.code == (2 if of_option else 3) and len(ran.err.splitlines()) == 1
    assert ran.err.startswith(f"error: {sentence}" if of_option else f"error: {path}: {sentence}")


def test_a_log_that_is_excluded_says_why(odd_logs, tmp_path, run_eaid):
    assert run_eaid("ingest", odd_logs, *SAYS, "-q", "--write-manifest", "-o", tmp_path / "a.h5").code == 0
    path = odd_logs / "dataset.toml"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes() + b'[exclude]\n"x_V=100_n1.csv" = "belt slipped"\n')
    ran = run_eaid("ingest", odd_logs, "-o", tmp_path / "b.h5")
    assert f"warning: {path}: 1 of 4 logs excluded (x_V=100_n1.csv: belt slipped)" in ran.err.splitlines()
    assert [len(level.names) for level in eaid.read(tmp_path / "b.h5").levels] == [1, 2]
