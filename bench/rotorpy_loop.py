"""rotorpy's own loop: one vehicle with its SE3 controller on a figure eight, at 100 Hz."""

from __future__ import annotations

from time import process_time

from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.trajectories.lissajous_traj import TwoDLissajous
from rotorpy.vehicles.hummingbird_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor


def real_time_factor(seconds: float) -> float:
    """Simulated over processor seconds; the first half second warms up and is not counted."""
    environment = Environment(
        vehicle=Multirotor(quad_params),
        controller=SE3Control(quad_params),
        trajectory=TwoDLissajous(A=0.73, B=0.365, a=0.63, b=1.26, height=1.0),
        sim_rate=100,
    )
    environment.run(t_final=0.5, plot=False, verbose=False)
    began = process_time()
    environment.run(t_final=seconds, plot=False, verbose=False)
    return seconds / (process_time() - began)
