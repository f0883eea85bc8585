"""The rehearsal: before anything arms, the engine flies a plan on ideal vehicles, as fast as it
can.

`rehearse` flies the plan and formats the result; `person` gives the events that a person would
give; `watch` makes the findings, with `arrivals` for its hints. The texts of findings are in
`findings`.
"""
