"""Studies made of arrays; tables and curves without copies; the model as a function."""

import multiprocessing
import pickle
import subprocess
import sys

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
import scipy.optimize

import misfit
from conftest import CHANNELS, connector, cycle, loop


def test_a_study_of_arrays_is_identified(small):
    done = small.fit()
    k, c = (p.value for p in done.parameters)
    assert k == pytest.approx(2e4, rel=2e-3) and c == pytest.approx(50.0, rel=2e-2)
    assert all(0.8 < t.error / t.floor < 1.3 for t in done.tests)


@pytest.mark.parametrize("frame", [pd.DataFrame, pl.DataFrame, lambda d: np.rec.fromarrays(list(d.values()), names=list(d)), dict])
def test_frames_of_all_kinds_give_the_same(frame):
    made = connector([cycle("slow", frame(loop(1.0)))])
    assert 0.5 * np.sum(made.residual([2e4, 50.0]) ** 2) == pytest.approx(
        0.5 * np.sum(connector([cycle("slow", loop(1.0))]).residual([2e4, 50.0]) ** 2), rel=1e-12
    )


def test_an_frf_of_arrays():
    f = np.linspace(5.0, 100.0, 80)
    w = 2 * np.pi * f
    h = -(w**2) / (2e4 - 0.5 * w**2 + 1j * 20.0 * w)
    data = {"f": f, "re": h.real, "im": h.imag, "coh": np.full(80, 0.999)}
    channels = [
        misfit.Channel("frequency", "f", "Hz"),
        misfit.Channel("real", "re", "m/s2/N"),
        misfit.Channel("imag", "im", "m/s2/N"),
        misfit.Channel("coherence", "coh", averages=20),
    ]
    test = misfit.Test("frf", "frf", data, channels, excite="m.x", respond="m.x", quantity="accelerance")
    spring = misfit.Effect("linear_stiffness", "c1.x", k=misfit.Value("15 N/mm", min="0 N/mm"))
    damper = misfit.Effect("viscous", "c1.x", c=misfit.Value("0.01 N s/mm", min="0 N s/mm"))
    made = misfit.study([test], [misfit.Connector("c1", "ground", "m")], [spring, damper], [misfit.Body("m", ["x"], mass="0.5 kg")])
    done = made.fit()
    assert [p.value for p in done.parameters] == pytest.approx([2e4, 20.0], rel=1e-3)
    curve = done.curve("frf")
    assert curve.kind == "frf" and curve.measured.dtype == np.complex128 and curve.abscissa == pytest.approx(f)
    assert np.abs(curve.computed - h).max() < 1e-2 * np.abs(h).max()


def test_a_saved_study_stands_alone(small, tmp_path):
    saved = small.save(tmp_path / "kept")
    assert saved.residual(saved.values) == pytest.approx(small.residual(small.values), rel=1e-12)
    with pytest.raises(misfit.Error, match="there already"):
        connector([cycle("slow", loop(1.0))], folder=tmp_path / "kept")


def test_the_jacobian_is_the_slope_of_the_residual(friction):
    friction.add("elastic_slip", at="c1.x")
    p = friction.values * 1.01
    r, j = friction.residual_and_jacobian(p, splits=["fit", "select"])
    assert r == pytest.approx(friction.residual(p, splits=["fit", "select"]), rel=1e-9, abs=1e-9)
    for k in range(len(p)):
        h = 1e-5 * p[k]
        up, down = (friction.residual(p + s * h * np.eye(len(p))[k], splits=["fit", "select"]) for s in (1, -1))
        assert (up - down) / (2 * h) == pytest.approx(j[:, k], rel=1e-2, abs=2e-4 * np.abs(j[:, k]).max())


def test_a_study_goes_to_other_processes(small):
    # Started anew: a process that is forked has none of the threads that compute.
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply(small.residual, (small.values,))
    assert there == pytest.approx(small.residual(small.values), rel=1e-12)


def test_scipy_drives_the_model(small):
    own = small.fit()
    least = scipy.optimize.least_squares(small.residual, small.values, jac=small.jacobian, bounds=small.bounds, x_scale="jac")
    assert least.cost == pytest.approx(own.cost, rel=1e-6)
    assert least.x == pytest.approx([p.value for p in own.parameters], rel=1e-5)


def test_tables_are_read_without_a_copy(small):
    table = small.fit().residuals
    arrow = pa.table(table)
    # Two exports of one table share their buffers, so a reader that copied would show another address.
    address = arrow["measured"].chunk(0).buffers()[1].address
    assert pa.table(table)["measured"].chunk(0).buffers()[1].address == address
    frame = pl.DataFrame(table)
    assert frame["measured"].to_numpy(allow_copy=False).ctypes.data == address
    as_pandas = pd.DataFrame.from_arrow(table)
    assert len(as_pandas) == len(table) == frame.height
    # With Arrow types the columns of pandas are these buffers; without, it gathers columns of numbers into blocks of its own.
    with_arrow_types = arrow.to_pandas(types_mapper=pd.ArrowDtype)
    assert pa.array(with_arrow_types["measured"].array).buffers()[1].address == address
    assert as_pandas["measured"].to_numpy() == pytest.approx(frame["measured"].to_numpy(), rel=0)
    assert list(as_pandas["test"]) == frame["test"].to_list() == table["test"]
    whitened = (frame["computed"] - frame["measured"]) / frame["sigma"]
    assert whitened.to_numpy() == pytest.approx(table["whitened"])


def test_fields_are_tables(small):
    done = small.fit()
    frame = pl.DataFrame(done.table("parameters"))
    assert frame["name"].to_list() == small.names and frame["value"].to_list() == [p.value for p in done.parameters]
    with pytest.raises(misfit.Error) as e:
        done.table("cost")
    assert "parameters" in e.value.accepted
    with pytest.raises(KeyError):
        done.residuals["nothing"]


def test_curves_are_arrays(small):
    done = small.fit()
    curve = done.curve("slow", "force")
    assert isinstance(curve.measured, np.ndarray) and len(curve.x) == len(curve.measured)
    assert curve.measured == pytest.approx(2e4 * curve.x + 50.0 * curve.v, abs=1.0)
    with pytest.raises(misfit.Error, match="no channel"):
        done.curve("medium")


def test_plots_and_the_report(small):
    done = small.fit()
    figure = done.plot("slow")
    panel = figure.axes[0]
    assert panel.get_title() == "slow" and len(panel.lines) == 2
    assert panel.lines[1].get_ydata() == pytest.approx(done.curve("slow").computed)
    page = done._repr_html_()
    assert page.startswith("<iframe srcdoc=") and "&lt;svg" in page
    with pytest.raises(misfit.Error, match="nothing to plot"):
        done.plot("medium")


def test_importing_takes_little():
    code = "import sys, time; t = time.perf_counter(); import misfit; print(time.perf_counter() - t, 'matplotlib' in sys.modules, 'numpy' in sys.modules)"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split() for _ in range(5)]
    assert min(float(r[0]) for r in runs) < 0.3 and runs[0][1:] == ["False", "False"]


def test_errors_travel(small):
    with pytest.raises(misfit.Error) as e:
        small.add("viscuos", at="c1.x")
    again = pickle.loads(pickle.dumps(e.value))
    assert (again.stage, again.where, again.message, again.accepted) == (e.value.stage, e.value.where, e.value.message, e.value.accepted)
    assert "viscous" in e.value.message and "viscous" in e.value.accepted and e.value.where == "viscuos"


# Bad input.


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda d: d["F"].__setitem__(7, np.nan), "row 7 is missing"),
        (lambda d: d["x"].__setitem__(3, np.inf), "row 3 is infinite"),
        (lambda d: d.update(F=d["F"][:-1]), "different lengths"),
        (lambda d: d.pop("F"), "no such column"),
        (lambda d: d.update(F=["much"] * len(d["t"])), "cannot be read as numbers"),
        (lambda d: d.update(F=np.ones((len(d["t"]), 2))), "2 dimensions"),
        (lambda d: d["t"].__setitem__(slice(100, 102), d["t"][[101, 100]]), ""),
        (lambda d: d.update({k: v[:0] for k, v in d.items()}), ""),
    ],
)
def test_bad_columns_are_refused(change, said):
    data = loop(1.0)
    change(data)
    with pytest.raises(misfit.Error) as e:
        connector([cycle("slow", data)])
    assert said in e.value.message and e.value.stage == "data" and e.value.accepted
    assert "slow" in e.value.where or "slow" in e.value.message


def test_a_frame_with_missing_values_is_refused():
    data = loop(1.0)
    for frame in [pd.DataFrame(data).shift(1), pl.DataFrame(data).with_columns(F=pl.lit(None))]:
        with pytest.raises(misfit.Error, match="missing"):
            connector([cycle("slow", frame)])


@pytest.mark.parametrize("p", [[1.0], [1.0, 2.0, 3.0], [np.nan, 1.0], [np.inf, 1.0], [[1.0, 2.0]], ["a", "b"]])
def test_bad_parameters_are_refused(small, p):
    with pytest.raises((misfit.Error, TypeError, ValueError)):
        small.residual(p)


def test_bad_words_are_refused(small):
    with pytest.raises(misfit.Error, match="no split"):
        small.residual(small.values, splits=["best"])
    with pytest.raises(misfit.Error, match="no effect"):
        small.add("nothing_such", at="c1.x")
    with pytest.raises(misfit.Error) as e:
        connector([cycle("slow", loop(1.0))], effects=[misfit.Effect("linear_stiffness", "c9.x", k="1 N/mm")])
    assert "c1.x" in e.value.accepted or "c1" in e.value.accepted
    with pytest.raises(misfit.Error):
        connector([cycle("slow", loop(1.0))], effects=[misfit.Effect("linear_stiffness", "c1.x", k="1 N")])
    with pytest.raises(misfit.Error):
        connector([misfit.Test("slow", "cycle", loop(1.0), [*CHANNELS, misfit.Channel("colour", "x", "m")])])
    with pytest.raises(misfit.Error):
        connector([cycle("slow", loop(1.0))], fit={"loss": object()})
    with pytest.raises(misfit.Error):
        misfit.load("/there/is/no/such/study")


def test_a_panic_is_an_error():
    with pytest.raises(misfit.Error, match="it broke") as e:
        misfit._native.panic("it broke")
    assert e.value.stage == "panic"


def test_the_stubs_are_those_of_the_native_part():
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "misfit._native"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_types_of_the_package_hold():
    """Its own code, and a user's: a field of a result has the type that the schema says."""
    use = "import misfit\nf = misfit.load('x').fit()\nreveal_type(f.termination)\nreveal_type(f.tests[0].worst.where)\nf.nothing"
    done = subprocess.run([sys.executable, "-m", "mypy", "-c", use], capture_output=True, text=True, check=False)
    assert done.stdout.count('Revealed type is "str"') == 2 or done.stdout.count('"builtins.str"') == 2, done.stdout
    assert '"Fit" has no attribute "nothing"' in done.stdout
    own = subprocess.run([sys.executable, "-m", "mypy", "-p", "misfit"], capture_output=True, text=True, check=False)
    assert own.returncode == 0, own.stdout
