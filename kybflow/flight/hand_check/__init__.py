"""The check of motion capture by hand: a person moves the vehicle as asked, before any rotor turns.

`motions` recognises each movement in the poses and the IMU samples; `verdict` judges by them the
scale, the axes and the body's heading. Neither uses a value of the simulator.
"""
