"""The keyboard of the terminal in which a mission flies. `pressed` decodes the keys, `offered`
assigns commands to them, `terminal_commander` gives the commands. The terminal is read between
ticks, without a thread."""
