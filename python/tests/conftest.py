"""Small studies that the tests share."""

import pathlib
import signal

import numpy as np
import pytest

import misfit

ROOT = pathlib.Path(__file__).parents[2]


@pytest.fixture(autouse=True, scope="session")
def ctrl_c():
    """A shell that runs the tests in the background has Ctrl-C ignored, and Python does not ask for it then."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def loop(frequency, amplitude=1e-3, force=None, cycles=4, seed=0):
    """A steady loop of one connector: time, displacement, force, with 0.2 % of noise."""
    t = np.arange(200 * cycles) / (200 * frequency)
    w = 2 * np.pi * frequency
    x, v = amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)
    f = (force or (lambda x, v: 2e4 * x + 50.0 * v))(x, v)
    return {"t": t, "x": x, "F": f + 0.002 * np.ptp(f) * np.random.default_rng(seed).standard_normal(len(f))}


CHANNELS = [
    misfit.Channel("time", "t", "s"),
    misfit.Channel("displacement", "x", "m", at="c1.x"),
    misfit.Channel("force", "F", "N", at="c1.x"),
]


def cycle(name, data, **more):
    return misfit.Test(name, "cycle", data, CHANNELS, control="displacement", discard_cycles=1, **more)


def connector(tests, effects=None, **more):
    """One connector, driven, with a spring and a damper."""
    spring = misfit.Effect("linear_stiffness", "c1.x", k=misfit.Value("10 N/mm", min="0 N/mm"))
    damper = misfit.Effect("viscous", "c1.x", c=misfit.Value("0.02 N s/mm", min="0 N s/mm"))
    return misfit.study(
        tests,
        [misfit.Connector("c1", "ground", "end")],
        effects or [spring, damper],
        [misfit.Body("end", ["x"])],
        **more,
    )


@pytest.fixture
def small():
    """A spring and a damper under two loops, made of arrays."""
    return connector([cycle("slow", loop(1.0)), cycle("fast", loop(5.0, seed=1))])


@pytest.fixture(scope="session")
def chain(tmp_path_factory):
    """Study 01 in a folder of its own."""
    return misfit.load(ROOT / "studies/01-hidden-effect").save(tmp_path_factory.mktemp("chain") / "study")


@pytest.fixture
def friction(tmp_path):
    """Study 08, one connector with two hidden effects, in a folder of its own."""
    return misfit.load(ROOT / "studies/08-two-effects").save(tmp_path / "study")
