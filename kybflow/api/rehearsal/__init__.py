"""The rehearsal: a plan, flown by the engine in a moment on ideal vehicles before anything arms.

`ideal` puts ideal vehicles in place of all that is hardware or simulated; `person` gives the events
that a person would; `watch` looks on and makes findings; `rehearse` joins them; `telling` has what
came of it as text. What a finding says is in `findings`.
"""
