"""Scenarios, what is done with them, and the command."""
