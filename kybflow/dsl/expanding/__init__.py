"""Expand the resolved tree to the plan as written: the target's drivers and sensors, a chain's
transitions in each of its states, cameras and solids. Each value is checked alone; checks of
several values follow in `kybflow.dsl.checks`. Only the compiler runs this pass, but checks and
`bind` call its functions to find which vehicles a flow drives and with what values a state is
entered."""
