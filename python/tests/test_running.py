"""What happens while a verb runs: progress, other threads, Ctrl-C, time limits."""

import _thread
import sys
import threading
import time
import types
import warnings

import numpy as np
import pytest

import misfit
from conftest import connector, cycle, loop
from misfit._progress import Progress


def test_progress_is_told(friction):
    told = []
    friction.ladder(progress=lambda words, fit: told.append((words, fit)))
    words = [w for w, _ in told if w]
    assert any("fit" in w for w in words) and len(words) > 3
    assert all(i >= 0 and cost >= 0 for _, fit in told if fit for i, cost in [fit])


def test_an_exception_of_the_progress_ends_the_verb(chain):
    told = []

    def tell(words, fit):
        told.append(words)
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        chain.ladder(progress=tell)
    # A ladder says some hundred things before its end.
    assert len(told) < 10


def test_other_threads_run_while_it_computes(chain):
    stop, turns = threading.Event(), []

    def count():
        while not stop.is_set():
            turns.append(time.perf_counter())
            time.sleep(0.001)

    other = threading.Thread(target=count)
    other.start()
    try:
        began = time.perf_counter()
        chain.fit(progress=False)
        ended = time.perf_counter()
    finally:
        stop.set()
        other.join()
    within = np.array([began, *[t for t in turns if began < t < ended], ended])
    # A lock held for the whole fit would leave one gap as long as the fit.
    assert np.diff(within).max() < 0.5 * (ended - began) and len(within) > 20


def test_two_verbs_at_once(friction, small):
    expected = small.fit(progress=False).cost
    costs = []
    threads = [threading.Thread(target=lambda: costs.append(small.fit(progress=False).cost)) for _ in range(3)]
    for t in threads:
        t.start()
    friction.fit(progress=False)
    for t in threads:
        t.join()
    assert costs == pytest.approx([expected] * 3, rel=1e-9)


def test_ctrl_c_keeps_the_best(chain):
    threading.Timer(1.0, _thread.interrupt_main).start()
    with pytest.warns(misfit.Interrupted, match="ladder was stopped"):
        done = chain.ladder(progress=False)
    assert done.stopped and done.interrupted and (done.folder / "study.toml").is_file()
    assert done.resolved().values.shape[0] >= len(chain.values)


def test_ctrl_c_where_there_is_nothing_to_keep():
    calls = []

    @misfit.law({"c": "N s/m"})
    def py_interrupts(v, c):
        calls.append(1)
        if len(calls) == 200:
            _thread.interrupt_main()
        return c * v

    effect = misfit.Effect("py_interrupts", "c1.x", c=misfit.Value("10 N s/m", min="0 N s/m"))
    made = connector([cycle("slow", loop(1.0))], effects=[misfit.Effect("linear_stiffness", "c1.x", k="20 N/mm"), effect])
    del calls[:]
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            made.residual(made.values)
    # And the next call is whole again.
    assert np.isfinite(made.residual(made.values)).all()


def test_the_time_limit_keeps_the_best_and_a_fit_goes_on(chain, tmp_path):
    with pytest.warns(misfit.Interrupted):
        done = chain.fit(max_seconds=0.05, out=tmp_path / "short", progress=False)
    assert done.stopped and done.termination == "interrupted"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = chain.fit(resume=tmp_path / "short", out=tmp_path / "long", progress=False)
    assert whole.termination == "converged" and whole.cost < done.cost


def test_the_bar_of_a_notebook(monkeypatch):
    shown = []

    class Handle:
        def update(self, html):
            shown.append(html)

    def display(html, display_id):
        shown.append(html)
        return Handle()

    ipython = types.ModuleType("IPython")
    ipython.get_ipython = lambda: types.SimpleNamespace(kernel=object())
    there = types.ModuleType("IPython.display")
    there.HTML, there.display = str, display
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", there)
    with Progress(100.0) as p:
        p("early", None)
        assert shown == []
        p.started -= 10
        p("fit <1>", None)
        p(None, (3, 12.5))
    assert len(shown) == 3 and shown[-1] == ""
    assert '<progress value="0.1' in shown[0] and "fit &lt;1&gt;" in shown[0]
    assert "fit &lt;1&gt;: iteration 3, cost 12.5" in shown[1]


def test_the_line_of_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    p = Progress()
    p.terminal, p.started = True, p.started - 2
    p("fit", None)
    p.__exit__()
    said = capsys.readouterr().err
    assert "2 s: fit" in said and said.endswith("\r")
