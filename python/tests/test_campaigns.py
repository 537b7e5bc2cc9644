"""Campaigns and trials from Python: their types, the program they start, what is wrong, Ctrl-C."""

import _thread
import subprocess
import sys
import threading
import time

import polars
import pytest

import misfit


def file(small, tmp_path, verb="fit", more=""):
    study = small.save(tmp_path / "saved").path.parent
    written = tmp_path / "many.toml"
    written.write_text(f'schema = 1\nverb = "{verb}"\nstudies = ["{study}"]\n{more}[grid]\nseed = [1, 2, 3]\n')
    return written


def test_a_campaign_gives_a_row_a_task(small, tmp_path):
    said = []
    made = file(small, tmp_path, more='[[variant]]\nname = "lost"\nstudy = "gone"\n')
    done = misfit.campaign(made, threads=2, progress=lambda words, fit: said.append(words))
    assert isinstance(done, misfit.results.Campaign) and (done.tasks, done.done, done.computed) == (4, 3, 4)
    assert [f.task for f in done.failed] == ["lost"] and "gone" in done.failed[0].reason and not done.interrupted
    table = polars.read_parquet(done.table_)
    assert len(table) == 4 and "parameters.c1.x.viscous.c.value" in table.columns
    expected = small.fit(progress=False).parameters
    found = {p.name: p.value for p in expected}["c1.x.viscous.c"]
    assert table["parameters.c1.x.viscous.c.value"][0] == pytest.approx(found, rel=1e-6)
    assert any("of 4 tasks" in w for w in said if w)
    with pytest.raises(misfit.Error, match="begun here") as e:
        misfit.campaign(made)
    assert "--resume" in e.value.accepted
    again = misfit.campaign(made, resume=True, out=tmp_path / "many-results")
    assert (again.computed, again.done) == (1, 3)


def test_what_is_no_campaign_is_said(tmp_path):
    (tmp_path / "many.toml").write_text('schema = 1\nverb = "fix"\nstudies = ["."]\n')
    with pytest.raises(misfit.Error, match="fix") as e:
        misfit.campaign(tmp_path / "many.toml")
    assert "many.toml" in e.value.where and "fit" in e.value.accepted
    with pytest.raises(misfit.Error) as e:
        misfit.trial(kinds=["three"], out=tmp_path / "trial")
    assert e.value.stage == "cli" and "three" in e.value.message


def test_ctrl_c_stops_the_tasks_and_resume_goes_on(friction, tmp_path):
    made = file(friction, tmp_path, verb="ladder")

    def interrupt():
        # The first ladder is under way where it has a folder of its run, on a machine of any speed.
        while not list(tmp_path.glob("many-results/work-*/run")):
            time.sleep(0.005)
        _thread.interrupt_main()

    def once(words, _fit):
        if words == "0 of 3 tasks":
            threading.Thread(target=interrupt, daemon=True).start()

    with pytest.warns(misfit.Interrupted, match="campaign was stopped"):
        done = misfit.campaign(made, threads=1, progress=once)
    # The ladder that was under way was told to stop: had it been waited for, it would be done.
    assert done.stopped and done.interrupted and done.done == 0 and not done.failed
    whole = misfit.campaign(made, resume=True, progress=False)
    assert whole.done == 3 and whole.computed == 3 and not whole.interrupted


def test_a_trial(tmp_path):
    done = misfit.trial(cases=2, models="connector", kinds=["none"], out=tmp_path / "trial", threads=2, progress=False)
    assert isinstance(done, misfit.results.Trial) and done.cases == 2 and not done.interrupted
    assert sum(c.count for c in done.confusion) == 2 and done.folder == tmp_path / "trial"
    more = misfit.trial(cases=3, resume=tmp_path / "trial", progress=False)
    assert more.cases == 3 and more.seed == done.seed


def test_the_program_of_the_package(small):
    def program(*words):
        return subprocess.run([sys.executable, "-m", "misfit", *map(str, words)], capture_output=True, text=True)

    assert program("--version").stdout.startswith("misfit ")
    fit = program("fit", small.path, "--json")
    assert fit.returncode == 0 and '"termination":"converged"' in fit.stdout
    assert program("fit", "/no/such/study", "--json").returncode == 1
    assert program("fitt").returncode == 2
