"""The verbs against the command line and against what is known of the studies."""

import importlib.util
import json
import pathlib
import re
import subprocess

import msgspec
import numpy as np
import pytest

import misfit
from conftest import ROOT, connector, cycle, loop

PROGRAM = ROOT / "target/release/misfit"


def test_a_fit_is_that_of_the_command_line(chain, tmp_path):
    done = chain.fit(out=tmp_path / "here")
    assert done.termination == "converged" and done.folder == tmp_path / "here" and not done.stopped
    program = subprocess.run([PROGRAM, "fit", chain.path, "--json", "--out", tmp_path / "there"], capture_output=True, check=True)
    there = json.loads(program.stdout)
    for key in ["cost", "n_residuals", "n_free", "iterations", "tests", "parameters", "effects", "notes"]:
        assert done.json[key] == there[key], key
    assert [p.name for p in done.parameters] == chain.names
    assert "base.x.linear_stiffness.k" in str(done)


def test_every_verb_gives_its_type(friction, tmp_path):
    checked = friction.check()
    assert checked.ok and all(f.moves_residual for f in checked.free)
    compared = friction.compare()
    before = {t.id: t.error for t in compared.tests}
    scores = friction.scores().scores
    assert scores[0].predicted_drop >= scores[-1].predicted_drop and any(s.promises for s in scores)
    found = friction.diagnose()
    assert isinstance(found, misfit.results.Diagnose) and found.verdict == "missing" and found.candidates
    added = friction.add("elastic_slip", at="c1.x", set={"d": "0.1 mm"})
    assert added.after.cost < 0.5 * added.before.cost
    assert "elastic_slip" in friction.path.read_text() and "c1.x.elastic_slip.f" in friction.names
    assert all(t.error < before[t.id] for t in added.after.tests)
    files = friction.export(to=["json", "csv"]).files
    assert len(files) >= 2 and all(pathlib.Path(f).is_file() for f in files)
    assert pathlib.Path(friction.report().file).read_text().startswith("<!")
    made = friction.simulate(noise="1 %", out=tmp_path / "rig")
    assert {t.id for t in made.tests} == set(before)
    with pytest.raises(misfit.Error, match="no prediction") as e:
        friction.predict()
    assert e.value.stage == "study" and "[[prediction]]" in e.value.accepted


def test_predictions():
    asked = {
        "case": "wide",
        "quantity": "W_D",
        "at": "c1.x",
        "control": "displacement",
        "displacement_min": "-2 mm",
        "displacement_max": "2 mm",
        "conditions": {"frequency": "3 Hz"},
    }
    made = connector([cycle(f"f{f}", loop(f, seed=f), conditions={"frequency": f"{f} Hz"}) for f in (1, 5)], prediction=[asked])
    done = made.predict()
    (p,) = done.predictions
    # Of a damper c the energy of a cycle is pi c w X^2.
    assert p.value == pytest.approx(np.pi * 50.0 * 2 * np.pi * 3.0 * 4e-6, rel=0.02) and p.unit == "J" and p.std > 0
    assert done.table("predictions")["value"] == pytest.approx([p.value])


def test_the_ladder_finds_what_is_hidden(friction):
    before = friction.path.read_text()
    found = friction.ladder()
    assert found.verdict == "missing" and found.proven
    assert {(m.effect, m.at) for m in found.missing} == {("bouc_wen", "c1.x"), ("maxwell", "c1.x")}
    assert friction.path.read_text() == before
    with_them = found.resolved()
    held_out = [t for t in with_them.compare().tests if t.split == "held_out"]
    assert held_out and all(t.error < 2 * t.floor for t in held_out)
    # What was stopped and is gone on with ends as if nothing had happened; what has come to its end is not gone on with.
    with pytest.warns(misfit.Interrupted):
        stopped = friction.ladder(max_seconds=1.0)
    again = friction.ladder(resume=stopped.result_study)
    assert stopped.interrupted and [r.cost for r in again.rungs] == [r.cost for r in found.rungs]
    assert again.verdict == "missing" and {(m.effect, m.at) for m in again.missing} == {("bouc_wen", "c1.x"), ("maxwell", "c1.x")}
    with pytest.raises(misfit.Error, match="no fits of an earlier ladder"):
        friction.ladder(resume=found.result_study)


def test_a_study_made_of_files(tmp_path):
    t = np.arange(800) / 200.0
    x = np.sin(2 * np.pi * t)
    rows = np.column_stack([t, x, 20 * x + 0.4 * np.cos(2 * np.pi * t)])
    np.savetxt(tmp_path / "loop.csv", rows, delimiter=",", header="t [s],x [mm],F [N]", comments="")
    made = misfit.new(tmp_path / "study", [tmp_path / "loop.csv"])
    assert made.made.found and made.path.is_file() and made.made.found[0].what


def test_a_study_that_does_not_load_is_checked(small, tmp_path):
    broken = small.save(tmp_path / "broken").path
    broken.write_text(broken.read_text().replace("c1.x", "c9.x", 1).replace("linear_stiffness", "linear_stifness", 1))
    checked = misfit.check(broken)
    assert not checked.ok and len(checked.problems) >= 1 and "linear_stiffness" in checked.problems[0].accepted
    with pytest.raises(misfit.Error) as e:
        misfit.load(broken)
    assert e.value.message == checked.problems[0].message
    assert misfit.check(small.path).ok


def test_the_library():
    laws = {law.effect: law for law in misfit.effects()}
    assert len(laws) > 30 and laws["viscous"].equation == "F = c v"
    assert misfit.effects("viscous")[0].parameters[0].name == "c"


def test_options_are_those_of_the_verbs(small):
    with pytest.raises(TypeError, match="no option 'sede'"):
        small.fit(sede=2)
    with pytest.raises(misfit.Error) as e:
        small.fit(threads=0)
    assert e.value.stage == "cli"
    one, two = small.fit(threads=1), small.fit(threads=2)
    assert one.cost == pytest.approx(two.cost, rel=1e-12)
    with pytest.raises(misfit.Error, match="command line"):
        misfit._native.call(["serve", str(small.path)])


def test_the_results_are_those_of_the_schemas():
    path = ROOT / "python/make-results"
    loader = importlib.machinery.SourceFileLoader("make_results", str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("make_results", loader))
    loader.exec_module(module)

    def fields(text):
        found, name = {}, ""
        for line in text.splitlines():
            name = line.split("(")[0].removeprefix("class ") if line.startswith("class ") else name
            if re.match(r"    \w+: ", line):
                field, kind = line.strip().split(": ", 1)
                found[name, field] = kind
            elif re.match(r"\w+ = ", line):
                found["", line.split(" = ")[0]] = line
        return found

    promised, given = fields((ROOT / "python/misfit/results.py").read_text()), fields(module.written())
    assert len(promised) > 200
    behind = sorted(key for key in given.keys() | promised.keys() if given.get(key) != promised.get(key))
    assert not behind, "results.py is not what python/make-results writes"


def test_a_result_of_another_form_is_refused():
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(b'{"ok": "perhaps"}', type=misfit.results.Check)
