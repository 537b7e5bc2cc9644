"""What every result has beside its fields: text, curves, tables, plots, the report."""

from __future__ import annotations

import html
import pathlib
from typing import TYPE_CHECKING, Any

import msgspec

from . import _native
from ._errors import Error

if TYPE_CHECKING:
    import matplotlib.figure

    from ._native import Curve, Table
    from ._study import Study


class Run(msgspec.Struct, kw_only=True, dict=True):
    """Base of the results of verbs. The fields are those of the JSON that the command line prints."""

    def _of(self, called: _native.Called, study: Study | None) -> Run:
        self.__dict__.update(_called=called, _study=study)
        return self

    @property
    def text(self) -> str:
        """What the command line prints of this result."""
        return self.__dict__["_called"].text

    @property
    def stopped(self) -> bool:
        """Whether Ctrl-C or the time limit ended the verb: the result is then the best state it had."""
        return self.__dict__["_called"].interrupted

    @property
    def json(self) -> dict[str, Any]:
        """The object that the command line prints with `--json`."""
        return msgspec.json.decode(self.__dict__["_called"].json)

    @property
    def curves(self) -> list[Curve]:
        """Every channel of every test against this result, as NumPy arrays."""
        return self.__dict__["_called"].curves

    @property
    def residuals(self) -> Table:
        """Every measured value with its computed one: test, channel, abscissa, part, measured, computed, sigma, whitened."""
        return self.__dict__["_called"].residuals

    def curve(self, test: str, channel: str = "") -> Curve:
        """The channel of `test` whose label begins with `channel`."""
        for c in self.curves:
            if c.test == test and c.label.startswith(channel):
                return c
        known = ", ".join(f"{c.test}: {c.label}" for c in self.curves)
        raise Error(f"there is no channel `{channel}` of a test `{test}`", "result", "curve", known or "a result with curves")

    def table(self, field: str) -> Table:
        """A field that is a list of records (`parameters`, `tests`, `candidates`, `predictions`, `rungs`, ...) as a table."""
        value = self.json.get(field)
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            lists = [k for k, v in self.json.items() if isinstance(v, list) and all(isinstance(r, dict) for r in v)]
            raise Error(f"`{field}` is no list of records of this result", "result", field, ", ".join(lists))
        return _native.Table.of_json(msgspec.json.encode(value).decode())

    @property
    def folder(self) -> pathlib.Path:
        """The folder of the run."""
        run = self.json.get("run", self.json.get("folder"))
        if run is None:
            raise Error("this result has no folder of a run", "result", "folder", "the result of a verb that leaves one")
        return pathlib.Path(run)

    def resolved(self) -> Study:
        """The study with the values and effects of this result, as it stands in the folder of the run."""
        from ._study import Study

        file = self.folder / "study.toml"
        if not file.is_file():
            raise Error("this run leaves no study", "result", str(self.folder), "the result of fit, add, ladder, diagnose or predict")
        own = self.__dict__["_study"]
        resolved = Study(file, data=own.data if own else None, seed=own.seed if own else 1)
        # A study made of arrays lives in a temporary folder, which is kept as long as what came of it.
        resolved._kept = own
        return resolved

    def plot(self, *tests: str) -> matplotlib.figure.Figure:
        """Measured and computed curves of these tests, of all without a name, as a matplotlib figure."""
        from ._plot import curves

        return curves([c for c in self.curves if not tests or c.test in tests])

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        run = self.json.get("run")
        report = pathlib.Path(run) / "report.html" if run else None
        if report is not None and report.is_file():
            page = html.escape(report.read_text(encoding="utf-8"), quote=True)
            return f'<iframe srcdoc="{page}" width="100%" height="640" style="border:0"></iframe>'
        return f"<pre>{html.escape(self.text)}</pre>"
