"""Documents of a run folder, changed by a test: with the digest of what they hold now, or without any."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tomli_w

from velodrome.engines.format_version import VERSION_KEY
from velodrome.scenarios.files import DIGEST_KEY, content_digest, file_digest
from velodrome.scenarios.run.folder import SCENARIO_DIGEST_KEY, SCENARIO_FILE


def sealed(document: Any) -> str:
    """JSON of a document with the digest of its contents; of what is no object, the JSON alone."""
    if not isinstance(document, dict):
        return json.dumps(document)
    return json.dumps(document | {DIGEST_KEY: content_digest(document)})


def contents(path: Path) -> dict[str, Any]:
    """A document without version and digest."""
    found = json.loads(path.read_text(encoding="utf-8"))
    return {key: value for key, value in found.items() if key not in (VERSION_KEY, DIGEST_KEY)}


def change_document(path: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change a document in place and seal it again, as if it had been written so."""
    document = json.loads(path.read_text(encoding="utf-8"))
    change(document)
    path.write_text(sealed(document), encoding="utf-8")


def change_scenario(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change the scenario of a run folder, with its digest in the manifest, as if it had been written so."""
    path = folder / SCENARIO_FILE
    scenario = tomllib.loads(path.read_text(encoding="utf-8"))
    change(scenario)
    path.write_text(tomli_w.dumps(scenario), encoding="utf-8")
    change_document(folder / "manifest.json", lambda found: found.update({SCENARIO_DIGEST_KEY: file_digest(path)}))


def age_folder(folder: Path) -> None:
    """Make a run folder one of before there were versions: no version, no digest, a scenario without resolved parts."""
    for name in ("manifest.json", "metrics.json"):
        document = contents(folder / name)
        if name == "manifest.json":
            del document["suite"], document["scenario_sha256"]
            document["platform"] = {key: document["platform"][key] for key in ("system", "machine", "python")}
        (folder / name).write_text(json.dumps(document), encoding="utf-8")
    scenario = tomllib.loads((folder / "scenario.toml").read_text(encoding="utf-8"))
    scenario |= {"bicycle": {}, "engines": {}}
    (folder / "scenario.toml").write_text(tomli_w.dumps(scenario), encoding="utf-8")
