"""The compiled simulator: exponential Radau steps for many parameter sets side by side."""
