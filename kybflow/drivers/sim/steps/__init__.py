"""The physics steps: rotors, IMUs and on-board control as functions of plain numbers, which run in
Python or compiled. They don't depend on the sensors' schedules or on links."""
