"""Jiminy as an engine of Velodrome: its wheel constraint rolls on the level plane."""
