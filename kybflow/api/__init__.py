"""The operations behind the command line and campaigns. They print nothing.

`experiment`, `missions`, `runs` and `replay` are what `import kybflow` offers. `export` writes runs
for other programs, `figures` draws them for papers, `compare` finds what differs between them, and
`replay` flies their records again.
`validation` checks missions and formats findings, whose codes `codes` explains; `flight` flies
missions or runs the preflight checks; `by_hand` checks motion capture while a person moves a
vehicle; `opening` opens their devices; `rehearsal` flies them on ideal vehicles; `library` finds
and copies shipped missions; `emulation` serves emulated vehicles; `calibration` reads and writes
the files of a camera's calibration; `recorded_input` records an input. Only this package combines
the plan, the drivers, the engine and the recording.
"""
