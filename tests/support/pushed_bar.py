"""A mission in which an AR.Drone pushes the plate of a bar that turns on a car on a rail."""

MISSION = """\
kybflow: 1
mission: push
summary: An AR.Drone pushes the plate of a bar, whose pivot slides on a rail.
import: {std: library/airframes.yaml}
world:
  fence: {from: [-2, -2, 0], to: [4, 2, 2.5]}
  objects:
    car:
      at: [0.5, 0, 80 cm]
      size: [16 cm, 16 cm, 10 cm]
      mass: 1 kg
      slide: {along: [1, 0, 0], from: 0 m, to: 3 m, friction: 0.4 N, damping: 0.3 N s/m}
    bar:
      on: car
      at: [0, 0, 20 cm]
      size: [6 cm, 1.2 m, 6 cm]
      mass: 500 g
      turn: {about: [0, 0, 1], from: -60 deg, to: 60 deg, friction: 0.01 N m, damping: 0.02 N m s}
      surfaces:
        left: {at: [-4 cm, 45 cm, 0], facing: [-1, 0, 0], width: 40 cm, height: 30 cm}
vehicles:
  v:
    like: std.ardrone_hull
    start: {at: [-0.7, 0.45, 0]}
    behaviors:
      up: {do: take_off, height: 1 m, then: touch}
      touch: {do: approach_contact, surface: bar.left, then: go}
      go:
        do: push
        surface: bar.left
        force: 0.45 N
        next: [{when: bar.angle < -12 deg, go: back}]
      back: {do: let_go, surface: bar.left, then: home}
      home: {do: fly_to, position: [-0.7, 0.45, 1], then: down}
      down: {do: land}
"""
