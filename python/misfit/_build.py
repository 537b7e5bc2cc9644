"""A study made of Python objects and arrays.

Each object has the keys of its table in study.toml or dataset.toml; keys that are not named here are given as further keyword arguments. Plain
dictionaries with those keys serve as well.
"""

from __future__ import annotations

import os
import pathlib
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from . import _native
from ._errors import Error
from ._study import Study


class Keys(dict[str, Any]):
    """The keys of one TOML table; those without a value are left out."""

    def __init__(self, **keys: Any) -> None:
        super().__init__({k: v for k, v in keys.items() if v is not None})


class Channel(Keys):
    """A channel of a test: role (time, displacement, force, frequency, real, imag, coherence, condition, ...), column and unit; `at` its place."""

    def __init__(self, role: str, column: str, unit: str | None = None, at: str | None = None, **more: Any) -> None:
        super().__init__(role=role, column=column, unit=unit, at=at, **more)


class Test(Keys):
    """A test: `data` holds its columns by name (a dictionary of arrays, a DataFrame, a structured array), `channels` says what they are."""

    __test__ = False  # pytest collects what is called Test.

    def __init__(self, id: str, kind: str, data: Any, channels: Sequence[Mapping[str, Any]], **more: Any) -> None:
        super().__init__(id=id, kind=kind, channels=[dict(c) for c in channels], **more)
        self.data = data


class Body(Keys):
    """A body with its free axes and its mass; `count` makes `name1`, `name2`, ..."""

    def __init__(
        self,
        name: str,
        free: Sequence[str] | None = None,
        mass: str | Mapping[str, Any] | None = None,
        count: int | None = None,
        **more: Any,
    ) -> None:
        super().__init__(name=name, free=None if free is None else list(free), mass=mass, count=count, **more)


class Connector(Keys):
    """A connector between two bodies, `from_` and `to`, or along a `chain` of bodies."""

    def __init__(self, name: str, from_: str | None = None, to: str | None = None, chain: str | None = None, **more: Any) -> None:
        super().__init__(name=name, to=to, chain=chain, **{"from": from_}, **more)


class Value(Keys):
    """A parameter: start with its unit, bounds, prior, or fixed."""

    def __init__(
        self,
        start: str,
        min: str | None = None,
        max: str | None = None,
        prior: tuple[str, str] | None = None,
        fixed: bool | None = None,
        **more: Any,
    ) -> None:
        known = None if prior is None else {"mean": prior[0], "sigma": prior[1]}
        super().__init__(start=start, min=min, max=max, prior=known, fixed=fixed, **more)


class Effect(Keys):
    """An effect at a place with its parameters, each a quantity with unit (`k="20 N/mm"`) or a `Value`."""

    def __init__(self, effect: str, at: str | Sequence[str], **parameters: Any) -> None:
        super().__init__(effect=effect, at=at if isinstance(at, str) else list(at), **parameters)


def study(
    tests: Iterable[Test],
    connectors: Iterable[Mapping[str, Any]],
    effects: Iterable[Mapping[str, Any]],
    bodies: Iterable[Mapping[str, Any]] = (),
    title: str | None = None,
    split: Mapping[str, Sequence[str]] | None = None,
    folder: str | os.PathLike[str] | None = None,
    seed: int = 1,
    **more: Any,
) -> Study:
    """A study made of these objects. Without `folder` its files are temporary and go with it; `save` keeps them.

    `more` are further keys of study.toml: `fit={"points": 64}`, `search={"places": ["c1.x"]}`, `order=[...]`, `prediction=[...]`.
    """
    temporary = tempfile.TemporaryDirectory(prefix="misfit-") if folder is None else None
    place = pathlib.Path(temporary.name if temporary else os.fspath(folder))  # type: ignore[arg-type]
    if (place / "study.toml").exists():
        raise Error("a study is there already", "study", str(place), "a new folder")
    listed, records = [], {}
    for k, test in enumerate(tests):
        file = f"{k + 1}-{re.sub(r'[^A-Za-z0-9_.-]', '-', str(test.get('id', '')))}.parquet"
        records[file] = columns(test)
        listed.append({"file": file, **test})
    whole = {
        "schema": 1,
        "title": title,
        "dataset": "data",
        "split": split,
        "body": list(bodies),
        "connector": list(connectors),
        "effect": list(effects),
        **more,
    }
    whole = {k: v for k, v in whole.items() if not (isinstance(v, list) and not v)}
    path = _native.write_study(place, _json(whole), _json({"schema": 1, "test": listed}), records)
    made = Study(path, seed=seed)
    # The folder lives as long as something that came of the study.
    made._kept = temporary
    return made


def columns(test: Test) -> list[tuple[str, Any]]:
    """The columns that the channels of a test name, as arrays of numbers."""
    import numpy as np

    if not isinstance(test, Test):
        raise Error("a test without data", "data", str(test.get("id", "")), "misfit.Test with its data")
    names = dict.fromkeys(c["column"] for c in test["channels"] if "column" in c)
    found = []
    for name in names:
        place = f"test `{test['id']}`, column `{name}`"
        try:
            values = np.asarray(test.data[name], dtype=np.float64)
        except (KeyError, IndexError, ValueError, TypeError) as e:
            missing = isinstance(e, (KeyError, IndexError)) or "no field" in str(e)
            message = "there is no such column" if missing else f"it cannot be read as numbers: {e}"
            raise Error(message, "data", place, "a column of numbers, one in every row") from e
        except Exception as e:  # polars has an error of its own for a column that is not there
            raise Error(f"it cannot be read: {e}", "data", place, "a column of numbers, one in every row") from e
        if values.ndim != 1:
            raise Error(f"an array with {values.ndim} dimensions", "data", place, "one dimension")
        found.append((name, np.ascontiguousarray(values)))
    lengths = {len(v) for _, v in found}
    if len(lengths) > 1:
        said = ", ".join(f"`{n}` {len(v)}" for n, v in found)
        raise Error(f"columns of different lengths: {said}", "data", f"test `{test['id']}`", "columns of one length")
    if lengths == {0}:
        raise Error("columns without rows", "data", f"test `{test['id']}`", "at least one row")
    for name, values in found:
        odd = np.flatnonzero(~np.isfinite(values))
        if len(odd):
            what = "missing (nan)" if np.isnan(values[odd[0]]) else "infinite"
            place = f"test `{test['id']}`, column `{name}`"
            message = f"the value in row {odd[0]} is {what}, {len(odd)} in all"
            raise Error(message, "data", place, "a finite number in every row; drop or fill the rows without one")
    return found


def _json(value: Any) -> str:
    try:
        return msgspec.json.encode(value).decode()
    except TypeError as e:
        raise Error(str(e), "study", "study.toml", "words, numbers, lists and dictionaries") from e
