"""The same bicycle in each engine."""
