"""Design of the next motion: families of motions, limits, the power of a motion, and the search for the best one."""
