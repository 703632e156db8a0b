"""Print when the files of a package were uploaded to the registries of pip's configuration, as one JSON object.

Run by path in a process of its own: ``python ask_upload_times.py PACKAGE``. Registries give the times in the JSON form
of their index (PEP 700). pip reads that form but prints no times, so this asks with pip's own session, which has its
addresses, certificates, proxies and credentials. The names below are private to pip; where they change, the process
fails, and dates are unknown.
"""

from __future__ import annotations

import json
import sys
from contextlib import suppress

_INDEX_TYPE = "application/vnd.pypi.simple.v1+json"
_PATIENCE = 15.0  # [s], of one connection


def main(package: str) -> None:
    """Print the upload time of every file, ISO 8601, by file name; null where no registry answers in that form."""
    from pip._internal.commands.download import DownloadCommand

    command = DownloadCommand("download", "")
    options, _ = command.parse_args(["--retries", "0", package])
    indexes = [] if options.no_index else [options.index_url, *options.extra_index_urls]
    found: dict[str, str] = {}
    answered = not indexes
    with command.main_context():
        session = command.get_default_session(options)
        for address in indexes:
            # A registry without this form, or out of reach, gives no times; another one may.
            with suppress(Exception):
                where = f"{address.rstrip('/')}/{package}/"
                page = session.get(where, headers={"Accept": _INDEX_TYPE}, timeout=_PATIENCE).json()
                times = {file["filename"]: file.get("upload-time") for file in page["files"]}
                found |= {name: time for name, time in times.items() if time is not None}
                answered = True
    print(json.dumps(found if answered else None))


if __name__ == "__main__":
    main(sys.argv[1])
