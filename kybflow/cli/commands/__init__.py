"""The commands. A command is the function `command` in the module of its name; the function's
signature declares the parameters. A package is a command with subcommands, and its docstring is
their help text. `COMMANDS` lists the commands in the order of the help."""

COMMANDS = (
    "run", "command", "validate", "rehearse", "test", "preflight", "record-input", "explain",
    "graph", "show", "export", "compare", "figure", "replay", "new", "library", "mocap-server",
    "parts", "schema", "tags", "calibrate", "mavlink", "emulate", "ardrone",
)  # fmt: skip
