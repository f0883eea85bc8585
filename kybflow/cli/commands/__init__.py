"""The commands. Each is the function `command` of the module of its name; its signature declares
the parameters. A package is a command with subcommands; its docstring is the help. `COMMANDS` has
the order of the help."""

COMMANDS = (
    "run", "command", "validate", "rehearse", "test", "preflight", "record-input", "explain",
    "graph", "show", "new", "library", "mocap-server", "parts", "schema", "tags", "calibrate",
    "mavlink", "emulate", "ardrone",
)  # fmt: skip
