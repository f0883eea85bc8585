"""How an emulated autopilot flies: what each mode makes of a setpoint, and its auxiliary outputs.

The position controller and the estimation are `emulation`'s; what differs between firmwares is in
`firmware`.
"""
