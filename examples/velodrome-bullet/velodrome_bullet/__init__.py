"""Bullet as an engine of Velodrome: its contact solver carries thin wheels on the level plane."""
