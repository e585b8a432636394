"""Fault detection: parameters that have changed since the model was made."""
