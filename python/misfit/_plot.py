"""Curves of tests as matplotlib figures."""

from __future__ import annotations

import functools
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ._errors import Error

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

    from ._native import Curve


@functools.cache
def shown() -> type[matplotlib.figure.Figure]:
    """The figure of matplotlib, with a picture for notebooks that have not loaded pyplot."""
    try:
        from matplotlib.figure import Figure
    except ImportError as e:
        raise Error("matplotlib is not installed", "plot", "matplotlib", "pip install 'misfit[plot]'") from e

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            picture = io.BytesIO()
            self.savefig(picture, format="png", dpi=100)
            return picture.getvalue()

    return Shown


def curves(list_of: Sequence[Curve]) -> matplotlib.figure.Figure:
    """One panel a channel: measured with dots, computed as a line."""
    if not list_of:
        raise Error("there is nothing to plot", "plot", "curves", "a result with curves, and the name of one of its tests")
    columns = min(3, len(list_of))
    rows = -(-len(list_of) // columns)
    figure = shown()(figsize=(4.6 * columns, 3.2 * rows), layout="constrained")
    for axes, curve in zip(figure.subplots(rows, columns, squeeze=False).flat, list_of):
        panel(axes, curve)
    for axes in list(figure.axes)[len(list_of) :]:
        axes.set_visible(False)
    return figure


def panel(axes: matplotlib.axes.Axes, curve: Curve) -> None:
    """One channel into these axes."""
    x, measured, computed = curve.abscissa, curve.measured, curve.computed
    style: dict[str, dict[str, Any]] = {"measured": dict(marker=".", ls="", ms=3, color="0.45"), "computed": dict(color="C3", lw=1.2)}
    if curve.kind == "frf":
        measured, computed = abs(measured), abs(computed)
        axes.set(xlabel="frequency [Hz]", yscale="log")
    elif curve.kind == "loop":
        if len(curve.x):
            x = curve.x
            axes.set_xlabel("driven displacement [SI]")
        else:
            axes.set_xlabel("phase [rad]")
    elif curve.kind == "record":
        axes.set_xlabel("time [s]")
    else:
        style["computed"] = dict(marker="x", ls="", color="C3")
        axes.set(xlabel="row", yscale="log")
    axes.plot(x, measured, label="measured", **style["measured"])
    axes.plot(x, computed, label="computed", **style["computed"])
    axes.set_ylabel(f"{curve.label} [{curve.unit}]", fontsize=8)
    axes.set_title(curve.test, fontsize=9)
    axes.legend(fontsize=7)
