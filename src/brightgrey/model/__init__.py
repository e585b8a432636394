"""The identified model as data."""
