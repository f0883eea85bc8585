"""What several commands share: parameters, each declared once, and what becomes of their values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from typer import BadParameter, Exit, Option

from kybflow.cli.output import echo
from kybflow.core.errors import KybflowError, UnitError
from kybflow.core.exit_codes import INVALID
from kybflow.core.files import write_whole
from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION, Dimension, parse_quantity

if TYPE_CHECKING:
    from kybflow.dsl.compiler import Result
    from kybflow.dsl.plan import Plan


class WrongUsage(BadParameter):
    """Parameters that don't go together. Its message needs no words before it."""

    def format_message(self) -> str:
        return self.message


def wrong(option: str | None, message: str) -> BadParameter:
    """The refusal of what was given for `option`, an argument perhaps; None where that is known."""
    return BadParameter(message, param_hint=option)


class Emitted(NamedTuple):
    """An event that somebody gives while it flies."""

    seconds: float
    name: str


class Change(NamedTuple):
    """Another value for a parameter of a part."""

    name: str
    value: str


def quantity(text: str, dimension: Dimension, option: str | None = None) -> float:
    """A quantity in SI. option: what it was given for, where that isn't known by itself."""
    try:
        return parse_quantity(text, dimension)
    except UnitError as error:
        raise wrong(option, f"{error}; {error.hint}" if error.hint else str(error)) from None


def duration(text: str) -> float:
    """A duration in seconds."""
    return quantity(text, DURATION)


def emitted(text: str) -> Emitted:
    """The event of `NAME@TIME`."""
    name, at, time = text.rpartition("@")
    if not at or not name.strip():
        raise BadParameter(f"`{text}` is not NAME@TIME")
    try:
        seconds = duration(time)
    except BadParameter as error:
        raise BadParameter(f"`{text}`: {error.message}") from None
    if seconds < 0.0:
        raise BadParameter(f"`{text}` is before the run")
    return Emitted(seconds, name.strip())


def change(text: str) -> Change:
    """The change of `NAME=VALUE`."""
    name, equals, value = text.partition("=")
    if not equals:
        raise BadParameter(f"`{text}` is not NAME=VALUE")
    return Change(name.strip(), value.strip())


def repeated(flag: str, **settings: Any) -> Any:
    """An option that may stand several times; without it the list of its values is empty."""
    return Option(flag, default_factory=list, show_default=False, **settings)


Target = Annotated[str | None, Option(help="Where to fly; `sim` by default.")]
Sets = Annotated[
    list[str], repeated("--set", metavar="NAME=VALUE", help="Set a parameter of the mission.")
]
Seed = Annotated[int, Option(help="Seed of everything that is drawn by chance.")]
Emits = Annotated[
    list[Emitted],
    repeated(
        "--emit",
        parser=emitted,
        metavar="NAME@TIME",
        help="Give an event while it flies, like operator.go@2s; TIME is that of the run. "
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
Out = Annotated[Path | None, Option(help="Run folder; runs/MISSION-TIME by default.")]
Format = Annotated[
    Literal["text", "json", "sarif", "github"],
    Option(help="For people, programs, code scanning or GitHub Actions."),
]
WriteTo = Annotated[Path | None, Option("--write", help="Write it to this file.")]
Check = Annotated[Path | None, Option(help="Fail unless this file is current.")]


def compiled(
    mission: Path, target: str | None = None, sets: Sequence[str] = ()
) -> tuple[Plan, Result]:
    """Compile a mission and print its findings. Exits with INVALID where it has no plan."""
    from kybflow.api.validation import findings
    from kybflow.dsl.compiler import compile_mission
    from kybflow.parts.catalog import load_catalog

    result = compile_mission(mission, catalog=load_catalog(), target=target, sets=sets)
    for text in findings(result, mission):
        echo(text, err=True)
    if result.plan is None:
        raise Exit(INVALID)
    return result.plan, result


@contextmanager
def failing(code: int, *errors: type[KybflowError], word: str = "error: ") -> Iterator[None]:
    """Tell an error of such a kind, after `word`, and exit with `code`."""
    try:
        yield
    except errors as error:
        echo(f"{word}{error}", err=True)
        raise Exit(code) from None


@contextmanager
def refusing(option: str, *errors: type[KybflowError]) -> Iterator[None]:
    """Tell an error of such a kind as one of what was given for `option`."""
    try:
        yield
    except errors as error:
        raise wrong(option, str(error)) from None


@contextmanager
def writing(path: Path, option: str) -> Iterator[None]:
    """Tell where `path`, which `option` names, can't be written."""
    try:
        yield
    except OSError as error:
        raise wrong(option, f"`{path}` can't be written: {error.strerror}") from None


def published(
    make: Callable[[], str], command: str, write_to: Path | None, check: Path | None
) -> bool:
    """Write what is made to `write_to`, or exit with INVALID unless `check` is that; whether either
    was asked for. command: what makes it, for the message."""
    if write_to is not None:
        with writing(write_to, "--write"):
            write_whole(write_to, make().encode())
    elif check is not None and not (
        check.is_file() and check.read_text(encoding="utf-8") == make()
    ):
        echo(f"{check} is not current; mend it with: {command} --write {check}", err=True)
        raise Exit(INVALID)
    return write_to is not None or check is not None


def unknown(what: str, name: str, known: Iterable[str], option: str) -> BadParameter:
    """The refusal of a name that nothing has. what: such as `there is no camera`."""
    return wrong(option, f"{what} `{name}`; {did_you_mean(name, known)}")
