"""The VRPN client in the wheel `motioncapture` as a program of its own: prints each pose it sees.

python cpp_vrpn_client.py HOST
"""

import sys

import motioncapture

capture = motioncapture.connect("vrpn", {"hostname": sys.argv[1]})
while True:
    capture.waitForNextFrame()
    for name, body in capture.rigidBodies.items():
        q = body.rotation
        sys.stdout.write(
            f"{name} {' '.join(str(float(x)) for x in (*body.position, q.w, q.x, q.y, q.z))}\n"
        )
        sys.stdout.flush()
