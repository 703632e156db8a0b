"""A stored run, looked at in the viewer or in a browser."""

from .viewing import RECORDING, open_native, serve

__all__ = ["RECORDING", "open_native", "serve"]
