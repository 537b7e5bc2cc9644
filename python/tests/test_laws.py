"""Laws written in Python: the same as those of the library, their slopes, their faults."""

import math
import threading

import numpy as np
import pytest

import misfit
from conftest import connector, cycle, loop

@misfit.law({"f": "N", "d": "mm"}, states=["u"])
def py_slip(dx, u, f, d):
    """A spring in series with a slider."""
    u = u + dx / d
    u = 1.0 if u > 1 else -1.0 if u < -1 else u
    return f * u, u


@misfit.law({"c": "N s/m", "tau": "s"}, states=["z"])
def py_maxwell(v, dt, z, c, tau):
    """A damper in series with a spring, by the backward formula of first order."""
    z = (z + v * dt) / (1 + dt / tau)
    return c / tau * z, z


def friction(x, v):
    return 2e4 * x + 50.0 * v + 5.0 * np.tanh(v / 1e-3)


def test_a_law_is_the_law_of_the_library(friction):
    own = friction.save(friction.path.parent / "own")
    there, here = friction.add("elastic_slip", at="c1.x"), own.add("py_slip", at="c1.x")
    assert here.after.cost == pytest.approx(there.after.cost, rel=1e-9)
    assert [p.value for p in here.after.parameters] == pytest.approx([p.value for p in there.after.parameters], rel=1e-6)
    p = friction.values
    assert own.jacobian(p) == pytest.approx(friction.jacobian(p), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "name, own, start",
    [
        ("elastic_slip", "py_slip", {"f": "3 N", "d": "0.1 mm"}),
        ("maxwell", "py_maxwell", None),
    ],
)
def test_small_motion_of_a_law(name, own, start):
    """An FRF sees the dynamic stiffness at rest: of an own law it comes from one step of its update."""
    f = np.linspace(5.0, 60.0, 40)
    h = 1 / (2e4 - 0.5 * (2 * np.pi * f) ** 2 + 1j * 40.0 * (2 * np.pi * f))
    channels = [misfit.Channel("frequency", "f", "Hz"), misfit.Channel("real", "re", "m/N", sigma="1 um/N"), misfit.Channel("imag", "im", "m/N", sigma="1 um/N")]
    law = misfit.effects(name)[0]
    starts = start or {"c": "30 N s/m", "tau": "20 ms"}
    of_library = start or {"k": "1500 N/m", "tau": "20 ms"}
    rows = []
    for effect, values in [(name, of_library), (own, starts)]:
        assert effect != name or set(values) <= {p.name for p in law.parameters}
        test = misfit.Test("frf", "frf", {"f": f, "re": h.real, "im": h.imag}, channels, excite="m.x", respond="m.x", quantity="receptance")
        spring = misfit.Effect("linear_stiffness", "c1.x", k="15 N/mm")
        more = misfit.Effect(effect, "c1.x", **values)
        rows.append(
            misfit.study([test], [misfit.Connector("c1", "ground", "m")], [spring, more], [misfit.Body("m", ["x"], mass="0.5 kg")])
        )
    (r1, j1), (r2, j2) = (s.residual_and_jacobian(s.values) for s in rows)
    assert r2 == pytest.approx(r1, rel=1e-4, abs=1e-4 * np.abs(r1).max())
    assert j2[:, 0] == pytest.approx(j1[:, 0], rel=1e-3, abs=1e-3 * np.abs(j1[:, 0]).max())
    moved = rows[1].values
    for k in range(len(moved)):
        h = 1e-4 * moved[k]
        up, down = (rows[1].residual(moved + s * h * np.eye(len(moved))[k]) for s in (1, -1))
        assert (up - down) / (2 * h) == pytest.approx(j2[:, k], rel=1e-3, abs=1e-3 * np.abs(j2[:, k]).max())


def test_the_search_tries_a_law_that_asks_for_it():
    @misfit.law({"s": "N"}, search=True)
    def py_creep(v, s):
        """Force that hardly grows with speed."""
        return s * np.arctan(v / 1e-3)

    try:
        data = [cycle(f"f{f}", loop(f, force=lambda x, v: 2e4 * x + 50.0 * v + 4.0 * np.arctan(v / 1e-3), seed=f)) for f in (1, 2, 5)]
        made = connector(data, search={"effects": ["py_creep", "cubic_stiffness"]})
        found = made.ladder()
        assert [m.effect for m in found.missing] == ["py_creep"]
        assert found.rungs[-1].parameters[-1].value == pytest.approx(4.0, rel=0.02)
    finally:
        misfit.law({"s": "N"}, name="py_creep")(lambda v, s: s * np.arctan(v / 1e-3))


def test_a_law_as_formula_is_the_same():
    data = [cycle("slow", loop(1.0, force=friction)), cycle("fast", loop(4.0, force=friction))]
    spring = misfit.Effect("linear_stiffness", "c1.x", k=misfit.Value("15 N/mm", min="0 N/mm"))
    damper = misfit.Effect("viscous", "c1.x", c=misfit.Value("0.02 N s/mm", min="0 N s/mm"))

    @misfit.law({"s": "N", "v0": misfit.Parameter("m/s", kind="setting", sign="> 0", default=1e-3)})
    def py_tanh(v, s, v0):
        """Friction, smooth about rest."""
        return s * np.tanh(v / v0)

    own = connector(data, effects=[spring, damper, misfit.Effect("py_tanh", "c1.x", s=misfit.Value("1 N", min="0 N", max="100 N"))])
    text = misfit.Effect(
        "formula",
        "c1.x",
        expression="s*tanh(v/v0)",
        s=misfit.Value("1 N", min="0 N", max="100 N"),
        v0=misfit.Value("1 mm/s", fixed=True),
    )
    formula = connector(data, effects=[spring, damper, text])
    one, two = own.fit(), formula.fit()
    assert one.cost == pytest.approx(two.cost, rel=1e-9)
    assert [p.value for p in one.parameters] == pytest.approx([2e4, 50.0, 5.0], rel=2e-2)


def test_a_law_that_raises_raises_from_the_verb():
    class Trouble(Exception):
        pass

    calls = []

    @misfit.law({"c": "N s/m"})
    def py_fails(v, c):
        calls.append(v)
        if len(calls) > 60:
            raise Trouble("no more")
        return c * v

    made = connector([cycle("slow", loop(1.0))])
    before = made.path.read_text()
    with pytest.raises(Trouble, match="no more"):
        made.add("py_fails", at="c1.x")
    # The fit that asked for it ended there: it would have gone on for thousands of calls.
    assert len(calls) < 200 and made.path.read_text() == before
    # The next call begins anew.
    assert made.fit().termination == "converged"


def test_a_fault_ends_the_call_that_it_belongs_to(small):
    @misfit.law({"c": "N s/m"})
    def py_fault(v, c):
        if threading.current_thread() is not threading.main_thread():
            raise RuntimeError("mine")
        return c * v

    expected = small.fit(progress=False).cost
    effect = misfit.Effect("py_fault", "c1.x", c=misfit.Value("10 N s/m", min="0 N s/m"))
    with pytest.raises(RuntimeError, match="mine"):
        connector([cycle("slow", loop(1.0))], effects=[misfit.Effect("linear_stiffness", "c1.x", k="20 N/mm"), effect]).fit()
    faulty = small.save(small.path.parent / "faulty")
    met, costs = [], []

    def fails():
        try:
            faulty.add("py_fault", at="c1.x", progress=False)
        except RuntimeError as e:
            met.append(str(e))

    threads = [threading.Thread(target=fails) for _ in range(3)]
    threads += [threading.Thread(target=lambda: costs.append(small.fit(progress=False).cost)) for _ in range(3)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert met == ["mine"] * 3 and costs == pytest.approx([expected] * 3, rel=1e-9)


def test_a_law_cannot_run_a_verb_and_progress_can(small):
    @misfit.law({"c": "N s/m"})
    def py_nested(v, c):
        if threading.current_thread() is not threading.main_thread():
            small.residual(small.values)
        return c * v

    with pytest.raises(misfit.Error, match="asked for a computation"):
        small.add("py_nested", at="c1.x")
    within = []
    small.fit(progress=lambda words, fit: within.append(len(small.residual(small.values))))
    assert within and within[0] == len(small.residual(small.values))


def test_a_law_that_gives_no_number_is_named():
    @misfit.law({"c": "N s/m"})
    def py_nan(v, c):
        return c * v * (float("nan") if abs(v) > 5e-3 else 1.0)

    spring = misfit.Effect("linear_stiffness", "c1.x", k=misfit.Value("15 N/mm", min="0 N/mm"))
    made = connector([cycle("slow", loop(1.0))], effects=[spring, misfit.Effect("py_nan", "c1.x", c=misfit.Value("10 N s/m", min="0 N s/m"))])
    with pytest.raises(misfit.Error, match="py_nan.*no finite number") as e:
        made.fit()
    assert "v = " in e.value.message
    with pytest.raises(misfit.Error, match="py_nan"):
        made.residual(made.values)


@pytest.mark.parametrize(
    "parameters, states, function, kind, said",
    [
        ({"c": "N s/m"}, [], lambda v, c: math.tanh(v) * c, TypeError, "no float"),
        ({"c": "N s/m"}, [], lambda v, c: (c * v, 1.0), misfit.Error, "returns 2 numbers"),
        ({"c": "N s/m"}, ["z"], lambda v, c, z: c * v, misfit.Error, "returns 1 numbers"),
        ({"c": "N s/m"}, [], lambda v, c: "much", TypeError, "must be real|float"),
        ({"c": "N s/m"}, [], lambda v, c: 1 / 0, ZeroDivisionError, "division"),
        ({"c": "N s/m"}, [], lambda v, c, y: c * v, misfit.Error, "argument `y`"),
        ({"c": "N s/m"}, [], lambda v, *c: v, misfit.Error, "no one meaning"),
        ({"c": "furlongs"}, [], lambda v, c: c * v, misfit.Error, "furlongs"),
        ({}, [], lambda v: v, misfit.Error, "no parameter"),
        ({"at": "N"}, [], lambda v, at: at * v, misfit.Error, "`at`"),
        ({"c": misfit.Parameter("N", kind="strong")}, [], lambda v, c: c * v, misfit.Error, "no kind"),
        ({"c": misfit.Parameter("N", sign="< 0")}, [], lambda v, c: c * v, misfit.Error, "no sign"),
    ],
)
def test_what_is_no_law_is_refused_where_it_is_defined(parameters, states, function, kind, said):
    with pytest.raises(kind, match=said):
        misfit.law(parameters, states=states, name="py_bad")(function)
    assert "py_bad" not in str(misfit._native.call(["schema", "study"]).json)


def test_names_of_the_library_and_laws_that_cannot_be_searched():
    with pytest.raises(misfit.Error, match="effect of the library"):
        misfit.law({"c": "N s/m"}, name="viscous")(lambda v, c: c * v)
    with pytest.raises(misfit.Error, match="not proportional") as e:
        misfit.law({"c": "N s/m"}, name="py_square", search=True)(lambda v, c: c * c * v)
    assert "search=False" in e.value.accepted


@pytest.mark.parametrize(
    "f",
    [
        lambda x: 3.0 * x - x / 2.0 + 2.0 / x,
        lambda x: x**3 - 2.0**x + x**0.5,
        lambda x: x**x,
        lambda x: np.sin(x) * np.cosh(x) + np.tan(x) - np.cos(x),
        lambda x: np.exp(-x) + np.expm1(x) * np.log1p(x),
        lambda x: np.log(x) + np.log10(x) + np.sqrt(x),
        lambda x: np.tanh(40 * x) + np.sinh(x) + np.arctan(x) + np.arcsinh(x),
        lambda x: np.arcsin(x / 2) + np.arccos(x / 2) + np.arctanh(x / 2),
        lambda x: abs(x - 2.0) + np.abs(-x) + max(x, 0.1) + min(x, 5.0),
        lambda x: np.float64(2.0) * x + np.float64(1.0) / x,
        lambda x: np.maximum(x, 0.0) + np.sign(x) * x,
    ],
)
def test_slopes_are_those_of_differences(f):
    """Seen through a law: the derivative of the residual with respect to the parameter of a law f(p) v."""
    misfit.law({"p": misfit.Parameter("", sign="any")}, name="py_any")(lambda v, p: 100.0 * f(p) * v)
    made = connector([cycle("slow", loop(1.0))], effects=[misfit.Effect("py_any", "c1.x", p=misfit.Value("0.7 -", min="0.1 -", max="5 -"))])
    r, j = made.residual_and_jacobian([0.7])
    plain = (made.residual([0.7 + 1e-6]) - made.residual([0.7 - 1e-6])) / 2e-6
    assert j[:, 0] == pytest.approx(plain, rel=1e-5, abs=1e-6 * np.abs(plain).max() + 1e-6)
    assert np.abs(r).max() > 0
