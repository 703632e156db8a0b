"""The protocol of engines, and the engines of the suite."""
