"""Figures of the app's pages, decimated where they are made."""
