"""What the command line and campaigns can do with a mission: `validation` checks it, `flight` flies
it or looks at it before take-off, `opening` opens its devices, `library` and `scaffold` find and
copy what packages ship, `emulation` opens what stands in for vehicles,
`calibration` reads and writes what belongs to a walk over tags. It alone joins the plan, the
drivers, the engine and the recording; it prints nothing, and nothing below it calls it.
"""
