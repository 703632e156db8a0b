"""Releases of a library: from which one on an engine rides, and what it does where a release lacks something.

An engine declares its `LibraryReach` as data. What a release lacks is either needed, so that older releases are refused
with one line, or it is left out or replaced, which is recorded in the settings of the trajectory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from importlib.metadata import PackageNotFoundError
from typing import TYPE_CHECKING, Any, Literal, cast

from packaging.version import InvalidVersion, Version

if TYPE_CHECKING:
    from .engine import Settings

# Keys under which the settings of a trajectory say what was done otherwise for an older release.
ADAPTATION_KEYS = ("left_out", "replaced")


@dataclass(frozen=True)
class Adaptation:
    """What an engine does otherwise in releases that lack something.

    Attributes
    ----------
    name : str
        Its key in documents.
    since : str
        First release with which nothing is done otherwise.
    how : {"left_out", "replaced"}
    text : str
        What is left out or put in its place, one line.
    first : str
        First release with which it is done; older ones have no use for it.
    """

    name: str
    since: str
    how: Literal["left_out", "replaced"]
    text: str
    first: str = "0"


@dataclass(frozen=True)
class LibraryReach:
    """The releases of a library with which an engine rides.

    Attributes
    ----------
    package : str
        The library's package.
    library : str
        The library's name in messages.
    oldest : str
        First release with which the engine rides.
    needs : str
        What that release has and older ones lack.
    adaptations : tuple of Adaptation
    values : mapping
        First release by setting and value, for values of settings that younger releases alone have.
    """

    package: str
    library: str
    oldest: str
    needs: str
    adaptations: tuple[Adaptation, ...] = ()
    values: Mapping[tuple[str, str], str] = field(default_factory=dict[tuple[str, str], str], hash=False)

    def find_refusal(self, engine: str, settings: Settings | None = None) -> str | None:
        """Return why an engine cannot ride with the installed release; None if it can.

        Parameters
        ----------
        engine : str
        settings : Settings, optional
            Values of settings that the release lacks are refused too.
        """
        if not self.has(self.oldest):
            return self.name_need(engine, self.oldest, self.needs)
        for (name, value), since in self.values.items():
            if getattr(settings, name, None) == value and not self.has(since):
                return self.name_need(f"{name} {value!r}", since, "which older releases do not know")
        return None

    def list_adaptations(self) -> dict[str, dict[str, str]]:
        """Return what is left out and what is replaced with the installed release, by the keys `ADAPTATION_KEYS`.

        Keys under which there is nothing are absent.
        """
        found: dict[str, dict[str, str]] = {}
        for each in self.adaptations:
            if self.has(each.first) and not self.has(each.since):
                found.setdefault(each.how, {})[each.name] = each.text
        return found

    def as_json(self, engine: str) -> dict[str, Any]:
        """Return the releases with which an engine rides as a JSON object."""
        return {
            "package": self.package,
            "oldest": self.oldest,
            "needs": self.needs,
            "installed": self.installed,
            "refusal": self.find_refusal(engine),
            "adaptations": [asdict(each) for each in self.adaptations],
            **{key: {} for key in ADAPTATION_KEYS},
            **self.list_adaptations(),
        }

    def has(self, since: str) -> bool:
        """Return whether the installed release is ``since`` or newer; previews count as the release that they precede.

        A build whose version cannot be read counts as newer than all releases, and so does a library that is not
        installed: what is wrong then is not its release.
        """
        if self.installed is None:
            return True
        try:
            return _read_release(self.installed) >= _read_release(since)
        except InvalidVersion:
            return True

    @property
    def version(self) -> str:
        """The installed release.

        Raises
        ------
        PackageNotFoundError
            If the library is not installed.
        """
        from .engine import package_version  # that module imports this one

        return package_version(self.package)

    @property
    def installed(self) -> str | None:
        """The installed release; None if the library is not installed."""
        try:
            return self.version
        except PackageNotFoundError:
            return None

    def name_need(self, subject: str, since: str, needs: str) -> str:
        """Return one line that says which release something needs and for what, and which one is installed."""
        return f"{subject} needs {self.library} {since} or newer ({needs}), this is {self.version}"


@lru_cache(maxsize=256)
def _read_release(version: str) -> Version:
    return Version(Version(version).base_version)


def refuse_releases(engine: str, settings: Settings, *reaches: LibraryReach) -> None:
    """Refuse a ride with installed releases of libraries that are out of an engine's reach.

    Raises
    ------
    UnsuitableProblem
        With the reason.
    """
    from .engine import UnsuitableProblem  # that module imports this one

    for reach in reaches:
        refusal = reach.find_refusal(engine, settings)
        if refusal is not None:
            raise UnsuitableProblem(refusal)


def split_adaptations(stated: Mapping[str, Any], own: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the settings that a trajectory states, and apart from them what was left out and replaced.

    Parameters
    ----------
    stated : mapping
        Settings of a trajectory.
    own : mapping
        Those that the engine was given; a setting of its own is no adaptation, whatever its name.
    """
    adapted = {key: stated[key] for key in ADAPTATION_KEYS if key in stated and key not in own}
    return {key: value for key, value in stated.items() if key not in adapted}, adapted


def list_stated_adaptations(stated: Mapping[str, Any]) -> list[str]:
    """Return the lines by which the settings of a trajectory say what was left out and replaced.

    Parameters
    ----------
    stated : mapping
        Settings of a trajectory.
    """
    found = [stated.get(key) for key in ADAPTATION_KEYS]
    lines = [cast("Mapping[str, object]", each).values() for each in found if isinstance(each, Mapping)]
    return [text for each in lines for text in each if isinstance(text, str)]


def find_reach(engine: object) -> LibraryReach | None:
    """Return the releases with which an engine rides, its ``reach``; None if it does not say."""
    found: Any = getattr(getattr(engine, "inner", engine), "reach", None)
    return found if isinstance(found, LibraryReach) else None
