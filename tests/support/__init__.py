"""Drives, models, recordings and programs that tests share."""
