"""A mission that waits on the ground for a person, and then hovers until one acts."""

MISSION = """
kybflow: 1
mission: waiting
import: {std: kybflow/airframes}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  nano:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      idle: {do: wait_on_ground, next: [{event: operator.go, go: up}]}
      up:   {do: take_off, height: 60 cm, then: hold}
      hold: {do: hover, for_time: 400 s, then: down}
      down: {do: land}
"""
