"""Kalman filters for drives with friction and backlash."""
