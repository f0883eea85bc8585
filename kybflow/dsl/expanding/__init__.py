"""The resolved tree to the plan as written: the target's drivers and sensors, a chain's transitions
in each of its states, cameras and solids made of their parameters. Each value is checked alone;
checks of several values follow in `kybflow.dsl.checks`. Only the compiler calls this folder, but
checks and `bind` ask it which vehicles a flow drives and with what values a state is entered."""
