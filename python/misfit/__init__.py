"""misfit calibrates models of flexible mechanical systems from FRFs and hysteresis loops, and finds out what physics a model is missing.

    import misfit

    s = misfit.load("studies/01-hidden-effect")
    print(s.fit())
    found = s.ladder()
    found.verdict, found.missing

Verbs run the code that the command line runs; their results have the fields of its JSON (`misfit.results`). Every number is in SI units where no
other unit stands beside it. What goes wrong is a `misfit.Error` with stage, where, message and accepted.
"""

from __future__ import annotations

from . import results
from ._build import Body, Channel, Connector, Effect, Test, Value, study
from ._errors import Error, Interrupted
from ._law import Parameter, law
from ._native import Curve, Dual, Table
from ._study import Study, campaign, check, effects, load, new, trial

__version__ = "0.1.0"

__all__ = [
    "Body",
    "Channel",
    "Connector",
    "Curve",
    "Dual",
    "Effect",
    "Error",
    "Interrupted",
    "Parameter",
    "Study",
    "Table",
    "Test",
    "Value",
    "campaign",
    "check",
    "effects",
    "law",
    "load",
    "new",
    "results",
    "study",
    "trial",
]
