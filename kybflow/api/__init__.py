"""The operations behind the command line and campaigns. They print nothing.

`validation` checks missions; `flight` flies them or runs the preflight checks; `opening` opens
their devices; `rehearsal` flies them on ideal vehicles; `library` and `scaffold` find and copy
shipped missions; `emulation` serves emulated vehicles; `calibration` reads and writes the files of
a camera's calibration. Only this package combines the plan, the drivers, the engine and the
recording.
"""
