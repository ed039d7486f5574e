"""Paths over a site and trajectories around what is in the way."""
