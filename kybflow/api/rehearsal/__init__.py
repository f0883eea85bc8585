"""The rehearsal: before anything arms, the engine flies a plan on ideal vehicles, as fast as it
can.

`ideal` replaces hardware and simulators by ideal vehicles; `person` gives the events that a person
would give; `watch` makes the findings, with `arrivals` for its hints; `rehearse` runs it all;
`report` formats the result. The texts of findings are in `findings`.
"""
