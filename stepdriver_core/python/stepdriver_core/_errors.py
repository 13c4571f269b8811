"""The errors of stepdriver_core."""

from __future__ import annotations

import typing
from typing import NamedTuple, Tuple

if typing.TYPE_CHECKING:
    from ._states import CoordinatedResult, HomingResult, MoveResult, ProbeResult


class Error(Exception):
    """The base of all errors of stepdriver_core. Its text is a whole sentence for the person who reads it."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class Refused(Error):
    """A command that can't be accepted at the moment. It has changed nothing."""


class NoSuchAxis(Refused, KeyError):
    """The machine has no axis of that name; the text names those that it has."""


class GpioError(Error):
    """A GPIO line can't be requested, written or read; the text names the line and the reason."""


class StateFileError(Error):
    """The positions of the axes couldn't be written to the state file; the text names the file and the reason."""


class ConfigIssue(NamedTuple):
    """One mistake in a configuration."""

    key: str
    """The full name of the parameter, such as ``axes/x/microsteps``."""
    message: str
    """Its value and what is allowed; continues the sentence that the key begins."""
    may_be_left_over: bool
    """The parameter should not be there, or contradicts another one."""


class ConfigError(Error):
    """All mistakes in a configuration: the text has a line for each."""

    def __init__(self, text: str, issues: Tuple[ConfigIssue, ...] = ()) -> None:
        super().__init__(text, issues)

    @property
    def issues(self) -> Tuple[ConfigIssue, ...]:
        """The mistakes one by one, as ConfigIssue."""
        return typing.cast("Tuple[ConfigIssue, ...]", self.args[1])


class Timeout(Error, TimeoutError):
    """A move or a latch hasn't ended in the time that wait() was given. It continues."""


class NotReached(Error):
    """A move ended before its target, by a stop, an endstop, a fault or another move: the text says how."""

    def __init__(self, text: str, result: MoveResult | CoordinatedResult) -> None:
        super().__init__(text, result)

    @property
    def result(self) -> MoveResult | CoordinatedResult:
        """How and where the move ended."""
        return typing.cast("MoveResult | CoordinatedResult", self.args[1])


class NotHomed(Error):
    """A homing was cancelled, or it failed: the text says why."""

    def __init__(self, text: str, results: Tuple[HomingResult, ...]) -> None:
        super().__init__(text, results)

    @property
    def results(self) -> Tuple[HomingResult, ...]:
        """How the homing of each axis ended, in that order."""
        return typing.cast("Tuple[HomingResult, ...]", self.args[1])


class NoContact(Error):
    """A probing that had to find a contact found none, or something ended it: the text says what."""

    def __init__(self, text: str, result: ProbeResult) -> None:
        super().__init__(text, result)

    @property
    def result(self) -> ProbeResult:
        """How the probing ended, and where the axes stand."""
        return typing.cast("ProbeResult", self.args[1])
