"""The bicycle in Exudyn."""
