"""Views of a stored run, in the native viewer or in a browser."""

from .viewing import open_native, serve

__all__ = ["open_native", "serve"]
