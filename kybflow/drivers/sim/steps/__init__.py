"""The physics steps: rotors, IMUs and on-board control as functions of plain numbers, which run in
Python or compiled. They know neither sensors' schedules nor links."""
