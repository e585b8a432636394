"""A model at work: analysis, state feedback, Kalman filter and fault detection."""
