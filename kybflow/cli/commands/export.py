"""`kybflow export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from kybflow.cli.arguments import WrongUsage, failing
from kybflow.cli.output import echo
from kybflow.core.errors import FAILED, KybflowError


def command(
    run: Annotated[Path, Argument(help="The run folder.")],
    *,
    csv: Annotated[bool, Option("--csv", help="Write tables as text, the default.")] = False,
    npz: Annotated[bool, Option("--npz", help="Write NumPy's arrays.")] = False,
    parquet: Annotated[bool, Option("--parquet", help="Write Parquet tables.")] = False,
    rosbag2: Annotated[bool, Option("--rosbag2", help="Write a bag of ROS 2.")] = False,
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
      kybflow export runs/figure_eight-1 --parquet --out eight
    """
    from kybflow.api.export import export
    from kybflow.api.runs import Run

    formats = {"csv": csv, "npz": npz, "parquet": parquet, "rosbag2": rosbag2}
    asked = [name for name, is_asked in formats.items() if is_asked] or ["csv"]
    if out is not None and len(asked) > 1:
        raise WrongUsage("--out names the folder of one format")
    with failing(FAILED, KybflowError):
        for name in asked:
            for path in export(Run.load(run), name, out or run / f"export-{name}"):
                echo(str(path))
