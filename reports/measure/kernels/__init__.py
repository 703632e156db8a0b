"""Compiled loops over the samples of a ride, in a fixed order: a ride has the same metrics wherever it is measured."""
