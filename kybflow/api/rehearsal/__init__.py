"""The rehearsal: before anything arms, the engine flies a plan on ideal vehicles, as fast as it
can.

`rehearse` flies the plan and formats the result; `person` gives the events that a person would
give; `watch` decides what is wrong; `findings` describes it.
"""
