"""Numbers with units and intervals as text."""
