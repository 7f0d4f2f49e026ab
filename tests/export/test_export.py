"""The one entry: what is refused, what is marked, what is written, and that it is written whole."""

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

import eaid
from eaid.errors import GainsError, UsageError
from eaid.export import export as room
from eaid.export.targets import TARGETS, log_header
from eaid.findings import finding, say
from eaid.findings.sentences.control import EXPORT_ROWS
from eaid.models.parameters import REFERENCE_PLANT
from eaid.results.codec import from_plain
from eaid.results.common import Input
from eaid.results.fit import Fit

from .conftest import KNOWN, PLANT, export, fit_of, gains_of


def codes(made):
    return [one.code for one in made.findings]


def test_gains_and_fit_give_all_laws_in_one_folder(tmp_path):
    made = export(gains_of(), fit_of(), {"folder": tmp_path / "rig"})
    assert made.laws == ("pi", "rc", "inverse", "plant") and made.dt_s == 1e-3
    assert sorted(path.name for path in (tmp_path / "rig").iterdir()) == sorted(made.files)
    assert codes(made) == ["export-guarantee-holds"]


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_every_file_but_vectors_names_what_it_is_made_of(tmp_path, target):
    inputs = (Input("my gains.json", "abc123"),)
    options = {"target": target, "folder": tmp_path / "rig", "inputs": inputs, "command": "eaid export x --as y"}
    made = export(gains_of(margins={"worst": {"rc": {"gain_db": 12.5}}}), fit_of(), options)
    for name in made.files:
        if name.endswith((".py", ".h", ".m")):
            assert "SPDX-License-Identifier: MIT" in (tmp_path / "rig" / name).read_text(), name
        if name in ("vectors.csv", "vectors.h", "check.py", "eaid_laws.py") or name.endswith((".fmu", "_block.m")):
            continue
        text = (tmp_path / "rig" / name).read_text()
        assert "SPDX-License-Identifier: MIT" in text, name
        for part in ("made by eaid", "my gains.json, sha256 abc123", "eaid export x --as y", "sample time 0.001 s"):
            assert part in text, name
        assert "RC 12.5 dB" in text, name


def test_without_files_the_results_digests_stand_at_the_head(tmp_path):
    export(gains_of(), fit_of(), {"folder": tmp_path / "rig"})
    head = (tmp_path / "rig" / "eaid_control.h").read_text()
    assert head.count("digest ") == 2


def test_an_unstable_loop_is_refused_with_its_duties_and_exported_anyway_marked(tmp_path):
    wild = gains_of(pi=KNOWN.pi._replace(K_P=2e5))
    options = {"folder": tmp_path / "rig", "law": ("pi",)}
    with pytest.raises(GainsError, match=r"PI: the loop is unstable at 1000 Hz around .* %; .*anyway="):
        export(wild, fit_of(), options)
    assert not (tmp_path / "rig").exists()
    made = export(wild, fit_of(), dict(options, anyway=True))
    assert codes(made)[:2] == ["export-anyway", "export-unstable"]
    assert "EXPORTED ANYWAY" in (tmp_path / "rig" / "eaid_control.c").read_text()
    assert export(wild, fit_of(), {"folder": tmp_path / "rc", "law": ("rc",)}).laws == ("rc",)


def test_gains_that_are_stable_at_their_rate_are_refused_at_one_that_is_too_slow(tmp_path):
    with pytest.raises(GainsError, match="RC: the loop is unstable at 20 Hz"):
        export(gains_of(), fit_of(), {"folder": tmp_path / "rig", "law": ("rc",), "rate_hz": 20.0})
    made = export(gains_of(), fit_of(), {"folder": tmp_path / "rig", "law": ("rc",), "rate_hz": 500.0})
    assert "export-other-rate" in codes(made) and made.dt_s == 0.002


def test_what_the_gains_themselves_call_unstable_is_refused(tmp_path):
    margins = {"points": [{"duty_pct": 30.0, "rc": {"stable": True}, "pi": {"stable": False}}]}
    with pytest.raises(GainsError, match=r"PI: the loop is unstable at 1000 Hz around 30 %"):
        export(gains_of(margins=margins), None, {"folder": tmp_path / "rig"})
    assert export(gains_of(margins=margins), None, {"folder": tmp_path / "rig", "law": ("rc",)}).laws == ("rc",)


def test_what_is_marked_stop_is_refused(tmp_path):
    options = {"folder": tmp_path / "rig"}
    stop = {"code": "some-stop", "severity": "stop", "subject": "nonlinear", "levels": [], "values": {}}
    with pytest.raises(GainsError, match="not identifiable: one level"):
        export(gains_of(unidentified="one level"), None, options)
    with pytest.raises(GainsError, match="plant rest on a fit that is not identifiable"):
        export(None, fit_of(identifiable=False), options)
    with pytest.raises(GainsError, match="did not converge"):
        export(None, fit_of(solver={"converged": False}), options)
    with pytest.raises(GainsError, match="some-stop"):
        export(gains_of(findings=[{**stop, "subject": "rc"}]), None, options)
    fit = msgspec.structs.replace(fit_of(), findings=gains_of(findings=[stop]).findings)
    with pytest.raises(GainsError, match="some-stop"):
        export(None, fit, options)
    assert not (tmp_path / "rig").exists()
    export(gains_of(), fit, {"folder": tmp_path / "rig", "law": ("rc",)})  # the plant is not in it
    linear = msgspec.structs.replace(fit_of(), findings=gains_of(findings=[{**stop, "subject": "linear"}]).findings)
    with pytest.raises(GainsError, match="some-stop"):
        export(gains_of(), linear, {"folder": tmp_path / "other", "law": ("rc",)})
    export(gains_of(), linear, {"folder": tmp_path / "other", "law": ("plant",)})


@pytest.mark.parametrize(
    ("marks", "code"),
    [({"guaranteed": False}, "export-guarantee-missing"), ({"phi_holds": False}, "export-guarantee-missing"),
     ({"guaranteed": None}, "export-guarantee-unknown")],
)  # fmt: skip
def test_the_guarantee_is_told(tmp_path, marks, code):
    plain = msgspec.to_builtins(gains_of())
    gains = msgspec.convert({**plain, "rc": {**plain["rc"], **marks}}, type(gains_of()))
    assert code in codes(export(gains, None, {"folder": tmp_path / "rig"}))


def test_a_plant_without_release_says_so(tmp_path):
    made = export(None, fit_of(REFERENCE_PLANT), {"folder": tmp_path / "rig"})
    assert codes(made) == ["export-no-release"]


def test_the_rigs_own_units_stand_everywhere(tmp_path):
    data = {"input_unit": "V", "output_unit": "N", "levels": [100.0, 300.0], "sample_rate_hz": 2000.0}
    plant = replace(PLANT, tau1=(0.3, 0, 0), tau2=(5.0, 0, 0), Ts=(0, 0.02, 0, 0), u_range=(100.0, 300.0))
    made = export(None, fit_of(plant, data=data), {"folder": tmp_path / "rig"})
    assert made.dt_s == 0.0005
    text = (tmp_path / "rig" / "eaid_control.h").read_text()
    assert "[N/V]" in text and "duty in V, torque in N" in text and "N·m" not in text and "%" not in text
    assert "0x1.2cp+8, /* duty_max = 300.0 V */" in (tmp_path / "rig" / "eaid_control.c").read_text()
    assert 'puts("time_s,input (V),output (N),reference (N)");' in (tmp_path / "rig" / "check.c").read_text()


@pytest.mark.parametrize(
    ("units", "read"), [(("V", "N"), ("V", "N")), (("%", "N·m"), ("%", "N·m")), (("1", "1"), ("a.u.", "a.u."))]
)
def test_the_rigs_log_is_read_in_its_units(units: tuple[str, str], read: tuple[str, str], tmp_path: Path) -> None:
    """A log of 90 V was taken for one in %, and one of 300 V refused."""
    rows = [f"{k / 50},{90 * (k >= 100)},{2 * (1 - math.exp(-max(k - 100, 0) / 20))},0" for k in range(500)]
    (tmp_path / "log.csv").write_text("\n".join([log_header(units), *rows]), encoding="utf-8")
    steps = eaid.read(tmp_path / "log.csv")
    assert (steps.input_unit, steps.output_unit) == read and [level.level for level in steps.levels] == [90.0]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"target": "cobol"}, "target= cobol: must be one of"),
        ({"law": ("rc", "magic")}, "law= magic: must be one of"),
        ({"law": ("rc", "rc")}, "law=: names rc twice"),
        ({"law": ()}, "law=: names nothing"),
        ({"precision": "half"}, "precision= half: must be one of"),
        ({"rate_hz": 0.0}, "rate_hz= 0"),
        ({"rate_hz": math.nan}, "rate_hz= nan"),
        ({"stuck_s": 0.0}, "stuck_s= 0"),
        ({"duty_on_fault": math.inf}, "duty_on_fault= inf"),
        ({"rate_filter_hz": 500.0}, "rate_filter_hz= is 500"),
    ],
)
def test_options_that_contradict_are_refused(tmp_path, options, said):
    with pytest.raises(UsageError, match=said):
        export(gains_of(), fit_of(), dict(folder=tmp_path / "rig", **options))
    assert list(tmp_path.iterdir()) == []


def test_a_law_that_was_not_given_is_named(tmp_path):
    with pytest.raises(UsageError, match=r"law= plant needs what was not given: fit.json"):
        export(gains_of(), None, {"folder": tmp_path / "rig", "law": ("plant",)})
    with pytest.raises(UsageError, match=r"law= rc needs what was not given: gains.json"):
        export(None, fit_of(), {"folder": tmp_path / "rig", "law": ("rc",)})
    with pytest.raises(UsageError, match="nothing to export: give gains"):
        export(None, None, {"folder": tmp_path / "rig"})


def test_an_earlier_export_is_replaced_when_asked_and_nothing_else_ever(tmp_path):
    folder = tmp_path / "rig"
    export(gains_of(), fit_of(), {"folder": folder})
    with pytest.raises(UsageError, match="exists already"):
        export(gains_of(), fit_of(), {"folder": folder})
    (folder / "check").write_text("what make built")
    export(gains_of(), fit_of(), {"folder": folder, "target": "yaml", "force": True})
    assert sorted(path.name for path in folder.iterdir()) == ["README.md", "parameters.yaml", "vectors.csv"]
    (folder / "main.c").write_text("the user's own")
    with pytest.raises(UsageError, match=r"holds main.c, which eaid export did not make"):
        export(gains_of(), fit_of(), {"folder": folder, "force": True})
    (folder / "main.c").rename(tmp_path / "elsewhere.c")
    (folder / "vectors.csv").unlink()
    (folder / "vectors.csv").symlink_to(tmp_path / "elsewhere.c")
    with pytest.raises(UsageError, match=r"holds vectors.csv"):
        export(gains_of(), fit_of(), {"folder": folder, "force": True})
    assert (tmp_path / "elsewhere.c").read_text() == "the user's own"
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(UsageError, match="is no folder"):
        export(gains_of(), fit_of(), {"folder": file, "force": True})
    with pytest.raises(UsageError, match="does not exist"):
        export(gains_of(), fit_of(), {"folder": tmp_path / "a" / "b"})


def test_a_failure_while_writing_leaves_the_earlier_export_whole(tmp_path, monkeypatch):
    folder = tmp_path / "rig"
    export(gains_of(), fit_of(), {"folder": folder})
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def broken(_job):
        yield "README.md", "half"
        raise RuntimeError("in the middle")

    monkeypatch.setitem(room.TARGETS, "c", broken)
    with pytest.raises(RuntimeError, match="in the middle"):
        export(gains_of(), fit_of(), {"folder": folder, "force": True})
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig"]


def test_every_sentence_is_said():
    values = {
        "rate_hz": 500.0, "made_hz": 1000.0, "unit": "%", "why": "one level", "missing": "rho, phi", "duty": 120.0,
        "low": 0.0, "high": 100.0, "rc_gain_db": 16.2, "rc_phase_deg": 78.1, "rc_delay_s": 0.0117, "pi_gain_db": None,
    }  # fmt: skip
    said = {code: say(finding(code, "rc", (10, 20), **values)) for code in EXPORT_ROWS}
    assert said["export-unstable"] == "rc: the loop is unstable at 500 Hz around 10 and 20 %; ask for slower gains"
    assert said["export-margins"].endswith("duties: RC 16.2 dB, 78.1 ° of phase, 0.0117 s of delay")
    assert "does not hold on this rig (missing: rho, phi)" in said["export-guarantee-missing"]
    assert len(set(said.values())) == len(EXPORT_ROWS)


@pytest.mark.parametrize(
    ("gains", "precision"),
    [
        (msgspec.structs.replace(gains_of(), duty_limits_pct=(0.0, math.inf)), "double"),
        (msgspec.structs.replace(gains_of(), duty_limits_pct=(0.0, 1e45)), "single"),
    ],
)
def test_numbers_that_no_rig_can_hold_are_refused(tmp_path, gains, precision):
    with pytest.raises(UsageError, match="precision cannot hold safely"):
        export(gains, None, {"folder": tmp_path / "rig", "precision": precision, "anyway": True})


def test_a_plant_whose_falls_are_all_as_quick_as_its_release_is_not_exported_as_another(tmp_path: Path) -> None:
    falls = [{"level": 50.0, "from": 80.0, "Ts": -1.0, "tau1": 0.21, "tau2": 5.0}]
    plain = msgspec.to_builtins(fit_of(replace(REFERENCE_PLANT, release=(0.2, 4.8))))
    quick = from_plain({**plain, "friction": {"levels": falls}}, Fit, "test")
    with pytest.raises(UsageError, match="as quick as its release"):
        export(None, quick, {"folder": tmp_path / "rig", "law": ("plant",)})
    assert not (tmp_path / "rig").exists()
