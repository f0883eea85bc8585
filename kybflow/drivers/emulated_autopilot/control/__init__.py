"""The flight of an emulated autopilot: its modes, setpoints and auxiliary outputs.

`emulation` provides the position controller and the estimation; `firmware` holds the differences
between firmwares.
"""
