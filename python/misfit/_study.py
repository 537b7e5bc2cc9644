"""The study and its verbs."""

from __future__ import annotations

import os
import pathlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

import msgspec

from . import _native, results
from ._errors import Error, Interrupted
from ._progress import Progress
from ._run import Run

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

R = TypeVar("R", bound=Run)
Tell = Callable[["str | None", "tuple[int, float] | None"], Any]
PathLike: TypeAlias = "str | os.PathLike[str]"


def run(kind: type[R], words: Sequence[str], study: Study | None, progress: bool | Tell, max_seconds: float | None) -> R:
    """Calls a verb with the words of the command line and reads its result."""
    if callable(progress):
        called = _native.call(list(words), progress)
    elif progress:
        with Progress(max_seconds) as shown:
            called = _native.call(list(words), shown)
    else:
        called = _native.call(list(words))
    if called.interrupted:
        warnings.warn(f"{words[0]} was stopped; the result is the best state it had", Interrupted, stacklevel=4)
    result = msgspec.json.decode(called.json, type=kind)
    result._of(called, study)
    return result


def load(path: PathLike, data: PathLike | None = None, seed: int = 1) -> Study:
    """The study at `path`: a folder with study.toml, or that file. `data` is where the raw files lie, if not where dataset.toml says."""
    return Study(path, data=data, seed=seed)


def new(folder: PathLike, files: Iterable[PathLike]) -> Study:
    """A study made of files of a test bench, to be confirmed by eye; what was found in them stands in its `made`."""
    words = ["new", os.fspath(folder), "--from", *(os.fspath(f) for f in files)]
    made = run(results.New, words, None, False, None)
    if made.problem is not None:
        p = made.problem
        raise Error(p.message, p.stage, p.where, p.accepted)
    made_study = Study(folder)
    made_study.made = made
    return made_study


def check(path: PathLike, data: PathLike | None = None) -> results.Check:
    """Everything that is wrong with the files of a study, also of one that cannot be loaded."""
    return run(results.Check, ["check", os.fspath(path), *_option("--data", data)], None, False, None)


def effects(name: str | None = None) -> list[results.Law]:
    """The library of effects, or the one of this name."""
    return run(results.Effects, ["effects", *([name] if name else [])], None, False, None).effects


def campaign(
    file: PathLike,
    on: Literal["local", "slurm"] = "local",
    resume: bool = False,
    out: PathLike | None = None,
    threads: int | None = None,
    progress: bool | Tell = True,
) -> results.Campaign:
    """One verb over the variants that campaign.toml names, every task in a process of its own: `threads` at a time on this machine, or as a job
    array of Slurm. What an earlier run has left undone is done with `resume`; Ctrl-C stops the tasks and keeps what is done."""
    words = ["campaign", os.fspath(file), f"--on={on}", *(["--resume"] if resume else []), *_option("--out", out), *_option("--threads", threads)]
    return run(results.Campaign, words, None, progress, None)


def trial(
    cases: int | None = None,
    seed: int | None = None,
    kinds: Iterable[str] = (),
    models: str | None = None,
    data: str | None = None,
    only: Iterable[str] = (),
    out: PathLike | None = None,
    resume: PathLike | None = None,
    write: PathLike | None = None,
    threads: int | None = None,
    max_seconds: float | None = None,
    progress: bool | Tell = True,
) -> results.Trial:
    """How often the search finds effects that generated cases hide; the options are those of `misfit trial`. `write` is a folder for the cases that
    were not found, `resume` that of an earlier trial to go on with. Ctrl-C keeps the cases that are done."""
    given: dict[str, Any] = {"cases": cases, "seed": seed, "models": models, "data": data, "out": out, "resume": resume, "write": write, "threads": threads}
    given |= {"max-seconds": max_seconds, "kinds": ",".join(kinds) or None, "only": ",".join(only) or None}
    words = ["trial", *(word for name, value in given.items() for word in _option(f"--{name}", value))]
    return run(results.Trial, words, None, progress, max_seconds)


class Study:
    """A model with its measurements: study.toml and the dataset it names.

    Verbs read the files anew, so that a file edited meanwhile counts. Each leaves its folder `runs/<time>-<verb>` in the study, or `out`.
    All take: `out` folder of the run, `threads`, `max_seconds` after which they stop with the best state, `progress` (True: shown; False; or
    a function of words and (iteration, cost)), `start` values of parameters in place of the study's, {"c1.x.viscous.c": "120 N s/m"}. Ctrl-C
    stops them with the best state as well.
    """

    made: results.New | None = None
    _kept: Any = None

    def __init__(self, path: PathLike, data: PathLike | None = None, seed: int = 1) -> None:
        given = pathlib.Path(path)
        self.path = given / "study.toml" if given.is_dir() else given
        """study.toml."""
        self.data = None if data is None else pathlib.Path(data)
        """Folder of the raw files, where it is not the one that dataset.toml says."""
        self.seed = seed
        """Seed of everything random."""
        self._model: _native.Model | None = None
        self.model  # noqa: B018  (what is wrong with the files is said where they are loaded)

    def __reduce__(self) -> tuple[Any, ...]:
        # Another process reads the files itself.
        return (Study, (self.path, self.data, self.seed))

    def __repr__(self) -> str:
        return f"Study({str(self.path)!r}: {len(self.names)} free parameters)"

    # The model as a function of its free parameters.

    @property
    def model(self) -> _native.Model:
        """The model as it was when it was loaded, or after `add`; `reload` reads the files anew."""
        if self._model is None:
            self._model = _native.Model(self.path, self.data, self.seed)
        return self._model

    def reload(self) -> Study:
        """Reads the files anew for `residual` and `jacobian`."""
        self._model = None
        self.model  # noqa: B018
        return self

    def refine(self, p: ArrayLike | None = None) -> Study:
        """Gives `residual` and `jacobian` as many time steps as the noise of the tests asks for at the parameters `p` (those of the study, where
        none are given), as a fit ends with."""
        self._model = self.model.refined(self.values if p is None else p)
        return self

    @property
    def names(self) -> list[str]:
        """Names of the free parameters, `at.effect.parameter`."""
        return self.model.names

    @property
    def units(self) -> list[str]:
        """The units in which the study states them; numbers here are in SI units."""
        return self.model.units

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the free parameters in the study [SI]."""
        return self.model.values

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Their lower and upper bounds [SI], in the form of `scipy.optimize.least_squares`."""
        return self.model.bounds

    def residual(self, p: ArrayLike, splits: Sequence[str] = ("fit",)) -> NDArray[np.float64]:
        """(computed - measured) / sigma of every value of the tests of `splits` (fit, select, held_out) at the parameters `p` [SI]."""
        return self.model.residual(p, list(splits))

    def jacobian(self, p: ArrayLike, splits: Sequence[str] = ("fit",)) -> NDArray[np.float64]:
        """Derivatives of `residual` with respect to `p`, exact, one row a residual."""
        return self.model.jacobian(p, list(splits))[1]

    def residual_and_jacobian(self, p: ArrayLike, splits: Sequence[str] = ("fit",)) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Both, from one evaluation of the model."""
        return self.model.jacobian(p, list(splits))

    # Verbs.

    def check(self, **common: Any) -> results.Check:
        """What is wrong with the files, and whether every free parameter moves a residual."""
        return self._verb(results.Check, "check", [], common)

    def fit(self, profile: Iterable[str] = (), bootstrap: int | None = None, resume: PathLike | None = None, **common: Any) -> results.Fit:
        """Identifies the model as it stands. `profile` names parameters for profile likelihoods ("all" for every one), `bootstrap` says how
        many refits to resampled residuals, `resume` is the folder of an interrupted run."""
        words = _option("--resume", resume) + _option("--bootstrap", bootstrap)
        words += ["--profile", ",".join([profile] if isinstance(profile, str) else profile)] if profile else []
        return self._verb(results.Fit, "fit", words, common)

    def compare(self, **common: Any) -> results.Compare:
        """Holds the model at the values of study.toml against every test."""
        return self._verb(results.Compare, "compare", [], common)

    def diagnose(self, **common: Any) -> results.Diagnose:
        """Fits, then says where the model fails, which effects explain it, and how sure that is."""
        return self._verb(results.Diagnose, "diagnose", [], common)

    def scores(self, **common: Any) -> results.Scores:
        """The score test alone: every effect at every place with the fall of the cost that it predicts. Nothing is refitted, and nothing concluded."""
        return self._verb(results.Scores, "diagnose", ["--scores"], common)

    def add(
        self,
        effect: str,
        at: str,
        set: Mapping[str, str] | None = None,
        of: str | None = None,
        condition: str | None = None,
        reference: str | None = None,
        keep_study: bool = False,
        **common: Any,
    ) -> results.Add:
        """Writes an effect into study.toml and refits. `set` gives starts of parameters with units, `{"d": "0.1 mm"}`; a coefficient takes
        `of` ("viscous.c"), `condition` and `reference`. With `keep_study` study.toml stays as it is, and `resolved()` of the result is the
        study with the effect."""
        words = [effect, "--at", at]
        for name, value in (set or {}).items():
            words += ["--set", f"{name}={value}"]
        words += _option("--of", of) + _option("--condition", condition) + _option("--reference", reference)
        words += ["--keep-study"] if keep_study else []
        done = self._verb(results.Add, "add", words, common)
        self._model = None
        return done

    def ladder(self, resume: PathLike | None = None, **common: Any) -> results.Ladder:
        """Diagnoses, adds, refits and prunes until no effect earns its place. The study stays as it is; `resolved()` of the result is the
        study with what was found. `resume` is the folder of a ladder that was stopped or killed: it ends as if nothing had happened."""
        return self._verb(results.Ladder, "ladder", _option("--resume", resume), common)

    def predict(self, bootstrap: int | None = None, resume: PathLike | None = None, **common: Any) -> results.Predict:
        """Fits, then computes the predictions that the study asks for, with standard deviations."""
        return self._verb(results.Predict, "predict", _option("--bootstrap", bootstrap) + _option("--resume", resume), common)

    def tolerance(self, **common: Any) -> results.Tolerance:
        """Tolerances of parts to distributions of energies: yields, contributions, the loosest tolerances that keep a yield."""
        return self._verb(results.Tolerance, "tolerance", [], common)

    def simulate(self, noise: str | None = None, cycles: int | None = None, **common: Any) -> results.Simulate:
        """Writes the dataset that the study's model would have given, with `noise` ("1 %") and `cycles` of every loop."""
        return self._verb(results.Simulate, "simulate", _option("--noise", noise) + _option("--cycles", cycles), common)

    def export(self, to: str | Iterable[str] = "json", test: str | None = None, **common: Any) -> results.Export:
        """Fits, then writes the calibrated set: json, csv, parquet, adams, exudyn, study."""
        words = ["--to", to if isinstance(to, str) else ",".join(to), *_option("--test", test)]
        return self._verb(results.Export, "export", words, common)

    def report(self, **common: Any) -> results.Report:
        """Fits and diagnoses, then writes one HTML page that opens offline; a notebook shows it."""
        return self._verb(results.Report, "report", [], common)

    def save(self, folder: PathLike) -> Study:
        """The study with all its data in `folder`, where it stands alone and may be changed, moved and sent."""
        _native.save_study(self.path, pathlib.Path(folder), self.data)
        return Study(folder, seed=self.seed)

    def _verb(self, kind: type[R], verb: str, words: list[str], common: dict[str, Any]) -> R:
        progress, max_seconds = common.pop("progress", True), common.get("max_seconds")
        start: Mapping[str, str] = common.pop("start", None) or {}
        words = [*words, *(word for name, value in start.items() for word in ("--start", f"{name}={value}"))]
        options = {"out": "--out", "seed": "--seed", "threads": "--threads", "max_seconds": "--max-seconds"}
        common = {"seed": self.seed, **common}
        for key in common.keys() - options.keys():
            raise TypeError(f"{verb}() has no option {key!r}; it takes {', '.join([*options, 'start', 'progress'])}")
        all_words = [verb, os.fspath(self.path), *words]
        for key, value in common.items():
            all_words += _option(options[key], value)
        return run(kind, [*all_words, *_option("--data", self.data)], self, progress, max_seconds)


def _option(name: str, value: Any) -> list[str]:
    return [] if value is None else [f"{name}={os.fspath(value) if isinstance(value, os.PathLike) else value}"]
