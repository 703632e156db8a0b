"""A stored run, looked at in the viewer or in a browser."""

from .viewing import open_native, serve

__all__ = ["open_native", "serve"]
