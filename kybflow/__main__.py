"""`kybflow` and `python -m kybflow`: the start of the command line."""

import os
import signal

from kybflow.core.errors import INTERRUPTED


def main() -> None:
    """The console's entry. Who interrupts it while it is still being imported ends it without a
    word: there is nothing to undo yet, and a library may take KeyboardInterrupt for a failure."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    from kybflow.cli.app import main as begin

    begin()


if __name__ == "__main__":
    main()
