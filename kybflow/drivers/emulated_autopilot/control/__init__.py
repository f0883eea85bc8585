"""The flight of an emulated autopilot: its modes, setpoints and auxiliary outputs.

The position controller and the estimation are `emulation`'s; what differs between firmwares is in
`firmware`.
"""
