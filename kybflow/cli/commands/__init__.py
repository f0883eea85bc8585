"""The commands: each is the function `command` of the module of its name, and the signature of that
function declares its parameters. A package is a command that has further ones; its docstring is the
help. `COMMANDS` are in the order of the help."""

COMMANDS = (
    "run", "command", "validate", "rehearse", "test", "preflight", "record-input", "explain",
    "graph", "show", "new", "library", "mocap-server", "parts", "schema", "tags", "calibrate",
    "mavlink", "emulate", "ardrone",
)  # fmt: skip
