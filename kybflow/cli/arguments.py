"""Parameters shared by several commands, and helpers that parse values and report errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple
from unicodedata import normalize

from typer import BadParameter, Exit, Option

from kybflow.cli.output import echo
from kybflow.core.errors import INVALID, KybflowError, PartError, UnitError
from kybflow.core.files import read_all, write_whole
from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION, Dimension, parse_quantity

if TYPE_CHECKING:
    from kybflow.dsl.compiler import Result
    from kybflow.dsl.plan import Plan


class WrongUsage(BadParameter):
    """An invalid combination of parameters. Its message has no prefix."""

    def format_message(self) -> str:
        return self.message


def wrong(option: str | None, message: str) -> BadParameter:
    """Return an error about an option or argument. option: None if the context names it already."""
    return BadParameter(message, param_hint=option)


class Emitted(NamedTuple):
    """An event to emit at a time of the run."""

    seconds: float
    name: str


class Change(NamedTuple):
    """A new value for a parameter of a part."""

    name: str
    value: str


def quantity(text: str, dimension: Dimension, option: str | None = None) -> float:
    """Parse a quantity to SI units. option: the option that it belongs to, if the context doesn't
    name it."""
    try:
        return parse_quantity(text, dimension)
    except UnitError as error:
        raise wrong(option, f"{error}; {error.hint}" if error.hint else str(error)) from None


def duration(text: str) -> float:
    """Parse a duration to seconds."""
    return quantity(text, DURATION)


def emitted(text: str) -> Emitted:
    """Parse `NAME@TIME`."""
    name, at, time = normalize("NFC", text).rpartition("@")
    if not at or not name.strip():
        raise BadParameter(f"`{text}` is not NAME@TIME")
    try:
        seconds = duration(time)
    except BadParameter as error:
        raise BadParameter(f"`{text}`: {error.message}") from None
    if seconds < 0.0:
        raise BadParameter(f"`{text}` has a negative time")
    return Emitted(seconds, name.strip())


def change(text: str) -> Change:
    """Parse `NAME=VALUE`."""
    name, equals, value = normalize("NFC", text).partition("=")
    if not equals:
        raise BadParameter(f"`{text}` is not NAME=VALUE")
    return Change(name.strip(), value.strip())


def repeated(flag: str, **settings: Any) -> Any:
    """Return an option that can be repeated; its default is an empty list."""
    return Option(flag, default_factory=list, show_default=False, **settings)


Target = Annotated[str | None, Option(help="The target to fly on; `sim` by default.")]
Sets = Annotated[
    list[str], repeated("--set", metavar="NAME=VALUE", help="Set a parameter of the mission.")
]
Seed = Annotated[int, Option(help="Seed of all random numbers.")]
Emits = Annotated[
    list[Emitted],
    repeated(
        "--emit",
        parser=emitted,
        metavar="NAME@TIME",
        help="Give an event at a time of the run, like operator.go@2s. "
        "operator.pause, .resume, .land, .reset and .stop act on every vehicle.",
    ),
]
Changes = Annotated[
    list[Change],
    repeated(
        "--option",
        parser=change,
        metavar="NAME=VALUE",
        help="Change a parameter of a part, like mk.processors.limit_speed.speed=50cm/s.",
    ),
]
Parts = Annotated[
    list[Path],
    repeated("--parts", metavar="FILE", help="Import this Python file, which defines a part."),
]
Out = Annotated[Path | None, Option(help="Run folder; runs/MISSION-TIME by default.")]
Format = Annotated[
    Literal["text", "json", "sarif", "github"],
    Option(help="Output for people, programs, code scanning or GitHub Actions."),
]
WriteTo = Annotated[Path | None, Option("--write", help="Write the output to this file.")]
Check = Annotated[Path | None, Option(help="Fail if this file is out of date.")]


def compiled(
    mission: Path,
    target: str | None = None,
    sets: Sequence[str] = (),
    parts: Sequence[Path] = (),
) -> tuple[Plan, Result]:
    """Compile a mission and print its findings. Exits with INVALID if the mission, or a part's
    file, is invalid."""
    from kybflow.api.missions import MissionInvalid, compile_plan
    from kybflow.api.validation import findings

    with failing(INVALID, PartError), failing(INVALID, MissionInvalid, word=""):
        plan, result = compile_plan(mission, target, sets, parts)
    for text in findings(result, mission):
        echo(text, err=True)
    return plan, result


@contextmanager
def failing(code: int, *errors: type[KybflowError], word: str = "error: ") -> Iterator[None]:
    """Print an error of these types, preceded by `word`, and exit with `code`."""
    try:
        yield
    except errors as error:
        echo(f"{word}{error}", err=True)
        raise Exit(code) from None


@contextmanager
def refusing(option: str, *errors: type[KybflowError]) -> Iterator[None]:
    """Turn an error of these types into an error about `option`."""
    try:
        yield
    except errors as error:
        raise wrong(option, str(error)) from None


@contextmanager
def writing(path: Path, option: str) -> Iterator[None]:
    """Turn an OSError into an error about `option` that names `path`."""
    try:
        yield
    except OSError as error:
        raise wrong(option, f"`{path}` can't be written: {error.strerror}") from None


def published(
    make: Callable[[], str], command: str, write_to: Path | None, check: Path | None
) -> bool:
    """Write the text to `write_to`, or exit with INVALID if `check` holds another text. Return
    whether either is given. make: returns the text. command: the command to name in the message."""
    if write_to is not None:
        with writing(write_to, "--write"):
            write_whole(write_to, make().encode())
    elif check is not None and not (check.is_file() and read_all(check) == make().encode()):
        echo(f"{check} is out of date; update it: {command} --write {check}", err=True)
        raise Exit(INVALID)
    return write_to is not None or check is not None


def unknown(what: str, name: str, known: Iterable[str], option: str) -> BadParameter:
    """Return an error about an unknown name. what: the start of its message, such as `there is no
    camera`."""
    return wrong(option, f"{what} `{name}`; {did_you_mean(name, known)}")
