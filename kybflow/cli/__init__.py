"""The command line.

Each module in `commands/` is a command; `printing/` formats longer outputs; `keys` reads the
keyboard during a run; `arguments` and `output` are shared by the commands; `app` assembles them.
"""
