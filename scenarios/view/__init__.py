"""Views of a stored run, in the native viewer or in a browser."""

from .viewing import find_recording, open_native, open_recording, serve, serve_recording, stored_page

__all__ = ["find_recording", "open_native", "open_recording", "serve", "serve_recording", "stored_page"]
