"""`kybflow` and `python -m kybflow`: the start of the command line."""

import os
import signal

from kybflow.core.errors import INTERRUPTED


def main() -> None:
    """The console's entry. An interrupt while kybflow is still being imported ends it silently:
    there is nothing to undo yet, and a library may take KeyboardInterrupt for a failure."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    from kybflow.cli.app import main as begin

    begin()


if __name__ == "__main__":
    main()
