"""Expand the resolved tree to the plan as written: the target's drivers and sensors, a chain's
transitions in each of its states, cameras and solids. This pass checks each value alone;
`kybflow.dsl.checks` then checks values against each other. Only the compiler runs this pass, but
checks and `bind` call its functions to find which vehicles a flow drives and with what values a
state is entered."""
