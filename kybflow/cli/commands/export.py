"""`kybflow export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from typer import Argument, Option

from kybflow.cli.arguments import failing
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED, KybflowError


def command(
    run: Annotated[Path, Argument(help="The run folder.")],
    *,
    format: Annotated[
        Literal["csv", "npz", "parquet", "rosbag2"], Option(help="What to write.")
    ] = "csv",
    out: Annotated[
        Path | None, Option(help="The new folder, or bag; RUN/export-FORMAT by default.")
    ] = None,
) -> None:
    """Write the signals of a run for other programs.

    Tables have one file for the ticks of a vehicle and one for each of its sensors; the names of
    columns end with their unit. Parquet and bags need `pip install 'kybflow[analysis]'`.

    \b
    Exit codes:
    0: everything is written.
    1: the run can't be read, or not be written there.

    \b
    Examples:
      kybflow export runs/figure_eight-1
      kybflow export runs/figure_eight-1 --format parquet --out eight
    """
    from kybflow.api.export import export
    from kybflow.api.runs import Run

    with failing(FAILED, KybflowError):
        for path in export(Run.load(run), format, out or run / f"export-{format}"):
            echo(str(path))
