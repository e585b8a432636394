"""Commands of brightgrey that the app runs: their arguments, their processes, and the queue that they wait in."""
