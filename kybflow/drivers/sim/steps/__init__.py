"""The physics steps: what rotors do, what IMUs feel, what on-board loops answer, as functions of
plain numbers that run in Python or compiled. Nothing here knows of sensors' schedules or links."""
