"""Views of a stored run, in the native viewer or in a browser."""

from .viewing import RECORDING, open_native, serve, stored_page

__all__ = ["RECORDING", "open_native", "serve", "stored_page"]
