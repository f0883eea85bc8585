"""`kybflow figure`."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option

from kybflow.cli import arguments
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED, KybflowError


def command(
    run: Annotated[Path, Argument(help="The run folder.")],
    name: Annotated[str | None, Argument(help="The figure; without it, they are listed.")] = None,
    *,
    pdf: Annotated[bool, Option("--pdf", help="Write RUN/NAME.pdf, as without --out.")] = False,
    out: Annotated[
        Path | None, Option(help="The file to write: .pdf, .svg or .png.", show_default=False)
    ] = None,
    vehicles: Annotated[list[str], arguments.repeated("--vehicle", help="Show only this vehicle.")],
    begin: Annotated[
        float | None,
        Option("--from", parser=arguments.duration, metavar="TIME", help="Begin at this time."),
    ] = None,
    end: Annotated[
        float | None,
        Option("--to", parser=arguments.duration, metavar="TIME", help="End at this time."),
    ] = None,
    wide: Annotated[bool, Option("--wide", help="As wide as two columns, 7.16 in.")] = False,
) -> None:
    """Draw a figure of a run for a paper, as wide as a column (3.5 in).

    The text has 8 pt, fonts are embedded, and colours can be told apart in grey. Needs
    `pip install 'kybflow[figures]'`.

    \b
    Exit codes:
    0: the figure is written.
    1: the run can't be read, or has nothing to show.
    2: the command line is invalid.

    \b
    Examples:
      kybflow figure runs/figure_eight-1
      kybflow figure runs/figure_eight-1 error --pdf
      kybflow figure runs/figure_eight-1 position --vehicle nano --from 5s --to 12s --out x.pdf
    """
    from kybflow.api.figures import FIGURES, write_figure
    from kybflow.api.runs import Run

    if name is None:
        for known, draw in FIGURES.items():
            echo(f"{known:10}  {draw.__doc__}")
        raise Exit(0)
    if name not in FIGURES:
        raise arguments.unknown("there is no figure", name, FIGURES, "NAME")
    if pdf and out is not None:
        raise arguments.WrongUsage("--pdf names no file; give --out alone")
    path = out or run / f"{name}.pdf"
    with arguments.failing(FAILED, KybflowError), arguments.writing(path, "--out"):
        span = (begin or 0.0, inf if end is None else end)
        write_figure(Run.load(run), name, path, vehicles=vehicles, span=span, wide=wide)
    echo(str(path))
