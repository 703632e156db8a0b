"""Basins of stable circles: which disturbances they survive, and what becomes of the others."""
