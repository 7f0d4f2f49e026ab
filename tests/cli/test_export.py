"""`eaid export`: exit codes, messages, files."""

import hashlib
import json

import pytest

from eaid.cli import main
from eaid.control.gains import paper_gains

RC, PI = paper_gains()
PLANT = {"tau1": [6.74e-3, 2.39e-2, -2.13e-4], "tau2": [0.93, 0.41, -2.64e-3], "Ts": [0.032, 9.2e-3, 2.1e-4, 1.32e-6]}


@pytest.fixture
def files(tmp_path, monkeypatch):
    """gains.json and fit.json of a user's script, where the command runs."""
    monkeypatch.chdir(tmp_path)
    gains = {
        "model": {"a0": RC.a0, "b0": RC.b0, "c0": RC.c0},
        "rc": {
            "K_P": RC.K_P, "K_D": RC.K_D, "B_hat": RC.B_hat, "epsilon": RC.epsilon, "gamma": RC.gamma,
            "rho": {"constant": RC.rho_constant, "slope": RC.rho_slope}, "Q": [[1, RC.Q12], [RC.Q12, RC.Q22]],
        },
        "pi": {"K_P": PI.K_P, "K_I": PI.K_I},
    }  # fmt: skip
    (tmp_path / "gains.json").write_text(json.dumps(gains))
    (tmp_path / "fit.json").write_text(json.dumps({"nonlinear": {**PLANT, "u_range": [10, 100]}}))
    return tmp_path


def test_gains_alone_give_their_controllers(files, capsys):
    assert main.run(["export", "gains.json"]) == 0
    told = capsys.readouterr()
    assert told.out == ""
    assert "export: pi, rc as c, 7 files; next: read export/README.md" in told.err
    assert "warning: RC: these gains do not say whether the guarantee holds" in told.err
    assert (files / "export" / "eaid_control.c").is_file()


def test_gains_and_fit_in_any_order_and_json(files, capsys):
    assert main.run(["export", "fit.json", "gains.json", "--as", "yaml", "--json", "-q", "-o", "rig"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["laws"] == ["pi", "rc", "inverse", "plant"] and told["dt_s"] == 0.001
    assert told["files"] == ["parameters.yaml", "vectors.csv", "README.md"]
    assert [one["code"] for one in told["findings"]] == ["export-guarantee-unknown", "export-no-release"]
    head = (files / "rig" / "parameters.yaml").read_text()
    assert "# from gains.json, sha256 " in head and "# from fit.json, sha256 " in head


def test_the_fit_that_gains_name_is_taken_where_it_lies_beside_them(files, capsys):
    content = json.loads((files / "gains.json").read_text())
    digest = hashlib.sha256((files / "fit.json").read_bytes()).hexdigest()
    content["inputs"] = {"fit": {"path": "somewhere/else/fit.json", "sha256": digest}}
    (files / "gains.json").write_text(json.dumps(content))
    assert main.run(["export", "gains.json", "--law", "rc,plant", "-o", "rig"]) == 0
    assert "with fit.json, which the gains were made from" in capsys.readouterr().err
    (files / "fit.json").write_text((files / "fit.json").read_text() + " ")  # another one by now
    assert main.run(["export", "gains.json", "--law", "rc,plant", "-o", "other"]) == 2
    assert "--law plant needs what was not given: fit.json" in capsys.readouterr().err


def test_a_fit_alone_gives_the_inverse_and_the_plant(files, capsys):
    assert main.run(["export", "fit.json", "--as", "yaml", "-o", "rig"]) == 0
    assert "rig: inverse, plant as yaml, 3 files" in capsys.readouterr().err


def test_the_command_stands_at_the_head(files, monkeypatch):
    arguments = ["export", "gains.json", "--law", "pi", "-o", "rig with space"]
    monkeypatch.setattr("sys.argv", ["eaid", *arguments])
    assert main.run(arguments) == 0
    text = (files / "rig with space" / "eaid_control.c").read_text()
    assert "by eaid export gains.json --law pi -o 'rig with space'" in text


def test_unstable_gains_are_refused_with_code_5_and_handed_on_anyway(files, capsys):
    content = json.loads((files / "gains.json").read_text())
    content["pi"]["K_P"] = 3e5
    (files / "gains.json").write_text(json.dumps(content))
    assert main.run(["export", "gains.json", "fit.json"]) == 5
    told = capsys.readouterr().err
    assert "PI: the loop is unstable at 1000 Hz" in told and "--anyway exports it all the same" in told
    assert not (files / "export").exists()
    assert main.run(["export", "gains.json", "fit.json", "--anyway"]) == 0
    assert "EXPORTED ANYWAY" in (files / "export" / "README.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["nowhere.json"], 3, "nowhere.json: no such file"),
        (["text.json"], 3, "text.json: is not a JSON file"),
        (["other.json"], 3, "other.json: is neither gains.json nor fit.json"),
        (["friction.json"], 3, "friction.json: holds no nonlinear model"),
        (["gains.json", "gains.json"], 2, "a second gains.json"),
        (["gains.json", "--as", "cobol"], 2, "--as cobol: must be one of c, arduino"),
        (["gains.json", "--law", "pid"], 2, "--law pid: must be one of pi, rc, inverse, plant; did you mean pi?"),
        (["gains.json", "--precision", "half"], 2, "--precision half: must be one of double, single"),
        (["gains.json", "--rate-hz", "-1"], 2, "--rate-hz -1: give a number"),
        (["gains.json", "--rate-hz", "nan"], 2, "--rate-hz nan: give a number"),
        (["gains.json", "-o", "no/where"], 2, "does not exist; make it first"),
        (["gains.json", "-o", "logs", "--force"], 2, "logs: holds rig.csv, which eaid export did not make"),
    ],
)
def test_refusals_are_one_sentence_and_write_nothing(files, capsys, arguments, code, said):
    (files / "text.json").write_text("hello")
    (files / "other.json").write_text(json.dumps({"schema": "eaid/plan/1"}))
    (files / "friction.json").write_text(json.dumps({"schema": "eaid/fit/1", "friction": {"C": 0.85}}))
    (files / "logs").mkdir()
    (files / "logs" / "rig.csv").write_text("time_s\n")
    before = sorted(path.name for path in files.iterdir())
    assert main.run(["export", *arguments]) == code
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1 and said in told[0] and told[0].startswith("error: ")
    assert sorted(path.name for path in files.iterdir()) == before
    assert (files / "logs" / "rig.csv").read_text() == "time_s\n"


def test_an_earlier_export_is_kept_without_force(files, capsys):
    assert main.run(["export", "gains.json", "-q"]) == 0
    assert main.run(["export", "gains.json", "-q"]) == 2
    assert "give --force to overwrite it" in capsys.readouterr().err
    assert main.run(["export", "gains.json", "-q", "--force", "--precision", "single", "--rate-hz", "500"]) == 0
    text = (files / "export" / "eaid_control.h").read_text()
    assert "typedef float eaid_real" in text and "0.002 s" in text
