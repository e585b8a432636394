"""Output to the terminal: results, progress, signals."""
