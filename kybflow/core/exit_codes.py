"""The exit codes of the command line; 0 is success."""

FAILED = 1
"""The command failed or was refused, its verdict is negative, or its output can't be written."""
INVALID = 2
"""A mission or a command line is not valid, and nothing ran."""
DRIVER_FAILED = 3
"""A vehicle or its emulator could not be reached or opened."""
INTERRUPTED = 130
"""The user interrupted the command."""
