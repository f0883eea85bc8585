"""The commands, one a module: its arguments, and the call that does the work. `kybflow.cli.app`
gathers them."""
