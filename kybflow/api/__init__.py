"""The operations of the command line and of campaigns. `validation` checks missions, `flight` flies
them or runs the preflight checks, `opening` opens their devices, `rehearsal` flies them on ideal
vehicles, `library` and `scaffold` find and copy shipped missions, `emulation` serves emulated
vehicles, `calibration` reads and writes the files of a camera's calibration. Only this package
joins the plan, the drivers, the engine and the recording. It prints nothing.
"""
