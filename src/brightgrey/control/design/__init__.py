"""Control design and simulation of the closed loop."""
