"""Laws written in Python."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from . import _native
from ._errors import Error

F = TypeVar("F", bound=Callable[..., object])


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A parameter of a law: its unit, what it is to the law, and where the search begins with it."""

    unit: str
    """Such as "N", "N/mm", "mm"; "" for a pure number."""
    kind: str = "strength"
    """strength: the force is proportional to it; shape: fitted, and tried over `grid`; setting: fixed at `default` unless a study frees it."""
    sign: str = ">= 0"
    """">= 0", "> 0" or "any"."""
    default: float = 0.0
    """Value of a setting [SI]."""
    grid: Sequence[float] = ()
    """Values that `add` and the search try for a shape."""
    of: str = ""
    """What `grid` is in multiples of: "x" the displacement amplitude at the place, "v" the velocity amplitude, "" nothing [SI]."""
    doc: str = ""
    """One line."""


def law(
    parameters: Mapping[str, str | Parameter],
    states: Sequence[str] = (),
    name: str | None = None,
    equation: str = "",
    search: bool = False,
) -> Callable[[F], F]:
    """Registers the decorated function as an effect, under its name, for every study that names it.

    The function gets what its arguments are called: `x`, `v`, `a` relative displacement, velocity and acceleration across the place, `dx` the
    increment of `x` over the time step `dt` [SI], the `states` as they were at the beginning of the step, the `parameters` [SI]. It returns the
    force at the end of the step, then the new states. `x` is that of the end `to` less that of `from`, the force what holds `to` there: +k x
    for a spring.

    It is called with floats and with `Dual` numbers, which carry exact derivatives: arithmetic, comparisons and the functions of NumPy do.

    A parameter is a unit or a `Parameter`; given as a unit, the first is a strength and the others are shapes, those that are a displacement or
    a velocity tried at multiples of what the tests show. With `search` the search for missing effects tries the law as well.

    Studies that were loaded before the function was defined again keep the earlier one; verbs take the new one.
    """

    def register(function: F) -> F:
        called = name or function.__name__
        stated = []
        for k, (key, p) in enumerate(parameters.items()):
            stated.append(_Stated(key, p if isinstance(p, Parameter) else _of_unit(p, k == 0)))
        arguments = []
        for a in inspect.signature(function).parameters.values():
            if a.kind not in (a.POSITIONAL_ONLY, a.POSITIONAL_OR_KEYWORD):
                raise Error(f"the argument `{a}` has no one meaning", "effect", called, "arguments by name, without * and **")
            arguments.append(a.name)
        claim = (inspect.getdoc(function) or "a law written in Python").splitlines()[0]
        _native.register(called, function, arguments, stated, list(states), claim, equation, search)
        return function

    return register


def _of_unit(unit: str, first: bool) -> Parameter:
    if first:
        return Parameter(unit)
    scale = {"m": "x", "mm": "x", "um": "x", "rad": "x", "deg": "x", "m/s": "v", "mm/s": "v", "rad/s": "v"}.get(unit)
    if scale is None:
        return Parameter(unit, kind="shape", sign="> 0")
    return Parameter(unit, kind="shape", sign="> 0", grid=(0.03, 0.1, 0.3, 0.8), of=scale)


class _Stated:
    """A parameter with its name, as the native part reads it."""

    def __init__(self, name: str, p: Parameter) -> None:
        self.name, self.unit, self.kind, self.sign = name, p.unit, p.kind, p.sign
        self.default, self.grid, self.of, self.doc = float(p.default), [float(g) for g in p.grid], p.of, p.doc or name
