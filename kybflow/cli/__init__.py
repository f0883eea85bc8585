"""The command line. Each module of `commands/` is a command; `printing/` formats longer outputs;
`keys/` reads the keyboard during a run; `arguments` and `output` are shared; `app` joins the
commands.
"""
