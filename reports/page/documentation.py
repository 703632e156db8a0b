"""Address of the documentation, for links from pages."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, metadata


def find_documentation() -> str | None:
    """Return the address of the documentation by the metadata of the installed package; None if it names none."""
    try:
        found = metadata("velodrome").get_all("Project-URL") or []
    except PackageNotFoundError:
        return None
    addresses = dict(entry.partition(", ")[::2] for entry in found)
    return addresses.get("Documentation", "").rstrip("/") or None
