"""Self-test of an identification: drives that are known are simulated, measured and identified as it was."""
