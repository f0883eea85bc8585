"""The keyboard of the terminal in which a mission flies.

`pressed` decodes the keys, `offered` assigns commands to them, and `terminal_commander` sends the
commands. The terminal is read between ticks, without a thread.
"""
