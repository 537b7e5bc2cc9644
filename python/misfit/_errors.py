"""Errors and warnings of the package."""

from __future__ import annotations


class Error(Exception):
    """What could not be done: the stage it failed in, where, what is wrong, and what would be accepted."""

    message: str
    stage: str
    where: str
    accepted: str

    def __init__(self, message: str, stage: str = "", where: str = "", accepted: str = "") -> None:
        super().__init__(message)
        self.message, self.stage, self.where, self.accepted = message, stage, where, accepted

    def __str__(self) -> str:
        lines = [self.message]
        lines += [f"  {name}: {text}" for name, text in [("where", self.where), ("accepted", self.accepted), ("stage", self.stage)] if text]
        return "\n".join(lines)

    def __reduce__(self):
        return (type(self), (self.message, self.stage, self.where, self.accepted))


class Interrupted(UserWarning):
    """A verb was stopped by Ctrl-C or its time limit; its result is the best state it had."""
