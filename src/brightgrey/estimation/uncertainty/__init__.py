"""Covariance, intervals and identifiability of estimates."""
