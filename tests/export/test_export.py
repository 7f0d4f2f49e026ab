"""The one entry: what is refused, what is marked, what is written, and that it is written whole."""

import json
import math
import re
import shutil
from pathlib import Path

import msgspec
import numpy as np
import pandas
import pytest
import yaml

import eaid
from eaid.control.defaults import input_limits
from eaid.findings import finding
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond

from .conftest import LAWS, PAPER, PLANT, compiled, fit_of, gains_of, merged, ran

TARGETS = ("c", "arduino", "matlab", "fmu", "yaml")
STOP = {"code": "some-stop", "severity": "stop", "subject": "nonlinear", "levels": [], "values": {}}


def codes(made):
    return [one.code for one in made.findings]


def test_gains_and_fit_give_all_laws_in_one_folder(tmp_path):
    made = eaid.export(gains_of(), tmp_path / "rig", fit_of())
    assert made.laws == ("pi", "rc", "pi-feedforward", "inverse", "plant") and made.dt_s == 1e-3
    assert sorted(path.name for path in (tmp_path / "rig").iterdir()) == sorted(made.files)
    assert codes(made) == ["export-guarantee-holds"]
    assert (tmp_path / "rig" / "eaid_control.h").read_text().count("digest ") == 2
    assert codes(eaid.export(None, tmp_path / "plant", fit_of(release=None))) == ["export-no-release"]


def test_a_turned_sign_is_said_with_what_torque_is(tmp_path):
    """A brake whose output falls: fed with what the rig measures, its law gives nothing."""
    fit = fit_of()
    turned = msgspec.structs.replace(fit, findings=(*fit.findings, finding("signs-turned", "data", runs=3)))
    made = eaid.export(None, tmp_path / "plant", turned)
    assert "export-sign-turned" in codes(made) and "less what the rig measures" in (made.path / "README.md").read_text()


@pytest.mark.slow
def test_an_input_that_rests_at_another_value_is_told_wherever_it_goes_to_the_rig(tmp_path):
    """Volts from 1.5 on: code that gave 0 to 6 V, as if from 0, in silence ended short of its reference."""
    plain, fit = fit_of(), fit_of(options={"reading": {"rest": 1.5}})
    made = eaid.export(gains_of(), tmp_path / "rig", fit)
    assert "0 to 100 % are 1.5 to 101.5 % there; add 1.5 to" in (made.path / "README.md").read_text()
    assert "input-from-rest" in codes(eaid.plan(fit)) and "input-from-rest" not in codes(eaid.plan(plain))


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_every_file_but_vectors_names_what_it_is_made_of_and_no_name_or_unit_breaks_it(
    tmp_path, monkeypatch, run_eaid, target
):
    from fmpy.validation import validate_fmu

    (tmp_path / "evil *").mkdir()
    monkeypatch.chdir(tmp_path)
    gains, fit = "evil */ int x; \"'''\\.json", "fit.json"
    margins = {"worst": {"rc": {"gain_db": 12.5}}}
    units = {"input_unit": 'V */ "', "output_unit": "N\n<m>"}
    (tmp_path / gains).write_text(json.dumps(merged(PAPER, {"margins": margins, **units})))
    (tmp_path / fit).write_text(json.dumps({**PLANT, "data": units}))
    words = ["export", gains, fit, "--as", target, "-o", "rig", "--json"]
    monkeypatch.setattr("sys.argv", ["eaid", *words])
    rig = tmp_path / "rig"
    for name in json.loads(run_eaid(*words).out)["files"]:
        if name.endswith((".csv", ".fmu")):
            continue
        text = (rig / name).read_text()
        assert "SPDX-License-Identifier: MIT" in text, name
        if name == "vectors.h" or name.endswith("_block.m"):
            continue
        for part in ("made by eaid", "int x;", "sha256 ", "by eaid export", "sample time 0.001 s", "RC 12.5 dB"):
            assert part in text, name
    if target in ("c", "arduino"):
        assert ran(compiled(rig), cwd=rig).returncode == 0 and ran("make", cwd=rig).stdout.count(": ok") == 6
    elif target == "yaml":
        assert yaml.safe_load((rig / "parameters.yaml").read_text())
    elif target == "fmu":
        assert validate_fmu(str(rig / "eaid_rc.fmu")) == []


def test_an_unstable_loop_is_refused_with_its_duties_and_exported_anyway_marked(tmp_path):
    wild = gains_of(pi={"K_P": 2e5})
    with pytest.raises(eaid.GainsError, match=r"PI: the loop is unstable at 1000 Hz around .* %; .*anyway="):
        eaid.export(wild, tmp_path / "rig", fit_of(), law=("pi",))
    assert not (tmp_path / "rig").exists()
    made = eaid.export(wild, tmp_path / "rig", fit_of(), law=("pi",), anyway=True)
    assert codes(made)[:2] == ["export-anyway", "export-unstable"]
    assert "EXPORTED ANYWAY" in (tmp_path / "rig" / "eaid_control.c").read_text()
    assert eaid.export(wild, tmp_path / "rc", fit_of(), law=("rc",)).laws == ("rc",)
    with pytest.raises(eaid.GainsError, match="RC: the loop is unstable at 20 Hz"):
        eaid.export(gains_of(), tmp_path / "slow", fit_of(), law=("rc",), rate_hz=20.0)
    made = eaid.export(gains_of(), tmp_path / "slow", fit_of(), law=("rc",), rate_hz=500.0)
    assert "export-other-rate" in codes(made) and made.dt_s == 0.002


def test_what_the_gains_themselves_call_unstable_is_refused(tmp_path):
    loops = {"rc": {"stable": True}, "pi": {"stable": False}}
    gains = gains_of(margins={"points": [{"duty_pct": 30.0, "loops": loops}]})
    with pytest.raises(eaid.GainsError, match=r"PI: the loop is unstable at 1000 Hz around 30 %"):
        eaid.export(gains, tmp_path / "rig")
    assert eaid.export(gains, tmp_path / "rig", law=("rc",)).laws == ("rc",)


@pytest.mark.parametrize(
    ("gains", "fit", "laws", "sentence", "others"),
    [
        ({"not_usable": "one level"}, None, None, "gains of a fit that is NOT USABLE: one level", None),
        ({"findings": [STOP | {"subject": "rc"}]}, None, None, "some-stop", None),
        (None, {"converged": False}, None, "plant of a fit that is NOT USABLE", None),
        (None, {"nonlinear": {"solver": {"converged": False}}}, None, "did not converge", None),
        ({}, {"findings": [STOP]}, ("plant",), "some-stop", ("rc",)),
        ({}, {"findings": [STOP | {"subject": "linear"}]}, ("rc",), "some-stop", ("plant",)),
    ],
)
def test_what_is_marked_stop_is_refused_where_it_concerns_the_law(tmp_path, gains, fit, laws, sentence, others):
    given = gains if gains is None else gains_of(**gains), tmp_path / "rig", fit if fit is None else fit_of(**fit)
    with pytest.raises(eaid.GainsError, match=sentence):
        eaid.export(*given, law=laws)
    assert not (tmp_path / "rig").exists()
    if others:
        assert eaid.export(*given, law=others).laws == others


@pytest.mark.parametrize(
    ("rc", "code"),
    [({"guaranteed": False}, "export-guarantee-missing"), ({"phi_holds": False}, "export-guarantee-missing"),
     ({"guaranteed": None}, "export-guarantee-unknown")],
)  # fmt: skip
def test_the_guarantee_is_told(tmp_path, rc, code):
    assert code in codes(eaid.export(gains_of(rc=rc), tmp_path / "rig"))


def test_the_rigs_own_units_stand_everywhere(tmp_path):
    model = {"tau1": [0.3, 0, 0], "tau2": [5.0, 0, 0], "Ts": [0, 0.02, 0, 0], "u_range": [100.0, 300.0]}
    data = {"input_unit": "V", "output_unit": "N", "levels": [100.0, 300.0], "sample_rate_hz": 2000.0}
    assert eaid.export(None, tmp_path / "rig", fit_of(nonlinear=model, data=data)).dt_s == 0.001  # not the logger's
    text = (tmp_path / "rig" / "eaid_control.h").read_text()
    assert "[N/V]" in text and "duty: the voltage in V, torque: the force in N" in text
    assert "N·m" not in text and "%" not in text
    assert "0x1.2c00000000000p+8, /* duty_max = 300.0 V */" in (tmp_path / "rig" / "eaid_control.c").read_text()


@pytest.mark.parametrize(
    ("units", "read"), [(("V", "N"), ("V", "N")), (("%", "N·m"), ("%", "N·m")), (("", ""), ("a.u.", "a.u."))]
)
def test_the_rigs_log_is_read_in_its_units(units, read, tmp_path):
    """A log of 90 V was taken for one in %, and one of 300 V refused."""
    eaid.export(None, tmp_path / "rig", fit_of(data={"input_unit": units[0], "output_unit": units[1]}))
    head = re.search(r'puts\("(time_s,.*)"\);', (tmp_path / "rig" / "check.c").read_text())[1]
    rows = [f"{k / 50},{90 * (k >= 100)},{2 * (1 - math.exp(-max(k - 100, 0) / 20))},0" for k in range(500)]
    (tmp_path / "log.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    steps = eaid.read(tmp_path / "log.csv")
    assert (steps.input_unit, steps.output_unit) == read and [level.level for level in steps.levels] == [90.0]


@pytest.mark.parametrize(
    ("gains", "options", "sentence"),
    [
        ({}, {"target": "cobol"}, "target= cobol: must be one of"),
        ({}, {"law": ("rc", "rc")}, "law=: names rc twice"),
        ({}, {"law": ()}, "law=: names nothing"),
        ({}, {"law": ("plant",)}, r"law= plant needs what was not given: fit.json"),
        (None, {}, "nothing to export: give gains"),
        ({"duty_limits_pct": [0.0, 1e45]}, {"anyway": True, "precision": "single"}, "precision cannot hold safely"),
    ],
)
def test_what_contradicts_or_is_not_given_is_refused(tmp_path, gains, options, sentence):
    with pytest.raises(eaid.UsageError, match=sentence):
        eaid.export(gains if gains is None else gains_of(**gains), tmp_path / "rig", **options)
    assert list(tmp_path.iterdir()) == []


def test_force_replaces_what_an_export_wrote_and_leaves_the_user_s_files(tmp_path, monkeypatch, run_eaid):
    monkeypatch.chdir(tmp_path)
    Path("gains.json").write_text(json.dumps(PAPER))

    def export(words=""):
        ran = run_eaid(*f"export gains.json -o rig -q {words}".split())
        return ran.err, {item.name for item in Path("rig").iterdir()}

    assert "rig.ino" in export("--as arduino")[1]
    assert "exists already; give --force" in export()[0]
    own = {"main.c": "mine", "check": "what make built", "log.csv": "time_s", "eaid_tuning.h": "mine too"}
    for name, text in own.items():
        Path("rig", name).write_text(text)
    assert export("--as yaml --force") == ("", {"README.md", "parameters.yaml", "vectors.csv", *own})
    assert {name: Path("rig", name).read_text() for name in own} == own
    for name, target in (("README.md", "c"), ("rig.ino", "arduino"), ("vectors.csv", "matlab")):
        before = Path("rig", name).read_bytes() if Path("rig", name).exists() else None
        Path("rig", name).write_text("the user's own\n")
        said, now = export(f"--as {target} --force")
        assert f"rig: holds {name}, which eaid export did not make" in said and "parameters.yaml" in now
        assert Path("rig", name).read_text() == "the user's own\n"
        Path("rig", name).unlink() if before is None else Path("rig", name).write_bytes(before)
    for target in ("c", "matlab", "yaml"):  # each finds its own files and those of another
        last = export(f"--as {target} --force")
    assert last == ("", {"README.md", "parameters.yaml", "vectors.csv", *own})
    Path("rig/vectors.csv").unlink(), Path("rig/vectors.csv").symlink_to(tmp_path / "gains.json")
    assert "holds vectors.csv" in export("--force")[0] and json.loads(Path("gains.json").read_text()) == PAPER
    for where, sentence in (("gains.json", "is no folder"), ("a/b", "does not exist")):
        assert sentence in run_eaid(*f"export gains.json -q --force -o {where}".split()).err


def octave(folder, code):
    return ran("octave", "--no-gui", "-q", "--norc", "--eval", code, cwd=folder)


@pytest.mark.skipif(not shutil.which("octave"), reason="no Octave")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_octave_repeats_the_vectors_refuses_another_sample_time_and_runs_the_block(exported, precision):
    done = octave(exported("matlab", precision), "printf('failed %d\\n', check());")
    assert "failed 0" in done.stdout, done.stderr
    assert re.search(r"largest difference (\S+),", done.stdout)[1] == "0"  # the bits
    code = (
        "s = eaid_rc_init(0.002); [u, s] = eaid_rc_step(s, 1, 0, 0); printf('%g %d\\n', u, s.status);"
        "[u, status] = eaid_rc_block(1, 0, 0); printf('%.17g %d\\n', u, status); m = [];"
        "[r, m] = eaid_rate_step(m, 1); [r, m] = eaid_rate_step(m, 2); printf('%.17g\\n', r);"
    )
    refused, block, rate = octave(exported("matlab"), code).stdout.splitlines()
    assert refused == "0 33" and block.split()[1] in ("0", "8")
    assert float(rate) == pytest.approx(145.4, rel=1e-3)


def test_the_yaml_holds_every_constant(exported, laws):
    told = yaml.safe_load((exported("yaml") / "parameters.yaml").read_text())["eaid_controller"]["ros__parameters"]
    assert told["sample_time_s"] == 1e-3 and told["output_unit"] == "N·m"
    for law, held in laws().constants.items():
        for name, value in vars(held).items():
            if name == "plant":
                assert told[law]["plant"]["tau1_1"] == value.tau1_1
            elif name != "series":
                assert told[law][name] == value and type(told[law][name]) is type(value)


@pytest.mark.parametrize("target", TARGETS)
def test_every_readme_is_one_page_with_units_and_the_list(exported, target):
    text = (exported(target) / "README.md").read_text()
    assert len(text.splitlines()) <= 70
    for word in ("Sign", "Zero", "Limits", "Watchdog", "Log", "N·m", "0.001 s", "{{"):
        assert (word in text) == (word != "{{")
    assert all(f"eaid_{law}" in text or target in ("yaml", "fmu") for law in LAWS[1:2])


@pytest.mark.slow
def test_a_rig_of_both_signs_gets_a_direction_pin_and_no_more_than_it_was_driven_with(tmp_path):
    """Its sketch clipped what is below 0, and −100 V was a limit of a rig that was driven with −20 V at most."""
    draw, t = np.random.default_rng(1), np.arange(0, 40, 0.01)
    u = np.where(t < 1, 0.0, draw.choice([-20.0, -10.0, 10.0, 30.0, 60.0, 100.0], 60)[(t / 0.7).astype(int)])
    plant = Plant((0.3,), (0.3,), (0.0, 0.05), (10.0, 100.0), C=1.0, Ts_below=(0.0, -0.05))
    y = respond(plant, t, u, t) + 0.004 * draw.standard_normal(len(t))
    fit = eaid.fit(pandas.DataFrame({"time (s)": t, "input (V)": u, "torque (N.m)": y}))
    gains = eaid.tune_rc(fit)
    made = eaid.export(gains, tmp_path / "rig", fit, target="arduino")
    assert input_limits(fit) == (-20.0, 100.0)
    other = eaid.fit(pandas.DataFrame({"time (s)": t, "input (V)": -u, "torque (N.m)": -y}))
    assert input_limits(other) == (-100.0, 20.0)
    assert "digitalWrite(DIRECTION_PIN, duty < 0" in (made.path / "rig.ino").read_text()
    assert "makes no negative" not in (made.path / "README.md").read_text()
    with pytest.raises(eaid.UsageError, match=r"6000: .* 166\.667, its period, is none; give 5988\.024 or 6024\.0964"):
        eaid.export(gains_of(), tmp_path / "quick", fit_of(), target="arduino", rate_hz=6000.0)
    one = eaid.export(gains_of(), tmp_path / "one", fit_of(), target="arduino").path
    assert not any("DIRECTION_PIN" in path.read_text() for path in one.iterdir())
