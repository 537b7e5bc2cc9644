"""Progress of a verb: a bar in a notebook, a line that moves on a terminal, nothing elsewhere."""

from __future__ import annotations

import html
import sys
import time
from typing import Any

QUIET = 1.0
"""Nothing is shown of what takes less than this [s]."""


class Progress:
    """Shows what a verb says of itself; `with Progress(...) as p` takes the display away at the end."""

    def __init__(self, limit: float | None = None) -> None:
        self.limit = limit
        self.started = time.monotonic()
        self.step = ""
        self.handle: Any = None
        self.line = 0
        shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
        self.notebook = shell is not None and hasattr(shell, "kernel")
        self.terminal = not self.notebook and sys.stderr is not None and sys.stderr.isatty()

    def __enter__(self) -> Progress:
        return self

    def __call__(self, words: str | None, fit: tuple[int, float] | None) -> None:
        """One event: a step of the work in words, or iteration and cost of a fit."""
        if words is not None:
            self.step = words
        text = self.step if fit is None else f"{self.step}: iteration {fit[0]}, cost {fit[1]:.6g}"
        seconds = time.monotonic() - self.started
        if seconds < QUIET:
            return
        if self.notebook:
            self._in_notebook(text, seconds)
        elif self.terminal:
            line = f"{seconds:.0f} s: {text}"[:118]
            print("\r" + line.ljust(self.line), end="", file=sys.stderr, flush=True)
            self.line = len(line)

    def _in_notebook(self, text: str, seconds: float) -> None:
        from IPython.display import HTML, display

        # Without a limit nobody knows how far it is: the bar moves without end.
        part = "" if self.limit is None else f' value="{min(seconds / self.limit, 1.0):.3f}"'
        shown = HTML(f"<progress{part}></progress> <code>{seconds:.0f} s: {html.escape(text)}</code>")
        if self.handle is None:
            self.handle = display(shown, display_id=True)
        else:
            self.handle.update(shown)

    def __exit__(self, *_: object) -> None:
        if self.handle is not None:
            from IPython.display import HTML

            self.handle.update(HTML(""))
        if self.line:
            print("\r" + " " * self.line + "\r", end="", file=sys.stderr, flush=True)
