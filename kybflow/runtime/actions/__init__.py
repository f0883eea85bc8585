"""Actions of packages: what a callback of a mission does. kybflow's own actions are part of the
language; a lab's package adds more in a folder of this name."""
