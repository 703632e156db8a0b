"""The one release that an option names, in an environment of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..error import ScenarioError
from ..scenario import show_value
from .children import Children
from .environments import NotInstallable, ReleaseEnvironment, open_environment
from .releases import Release, ReleaseRange, parse_release_range


def parse_one_release(wanted: str, wheels: Sequence[Path], option: str) -> ReleaseRange:
    """Parse ``PACKAGE==VERSION``, or the package alone where wheels are the release.

    Parameters
    ----------
    wanted : str
    wheels : sequence of Path
    option : str
        What names the release, for errors.

    Raises
    ------
    ScenarioError
        If it names another number of releases.
    """
    asked = parse_release_range(wanted)
    where = f"{option} {show_value(repr(wanted))}"
    if wheels and asked.alternatives:
        raise ScenarioError(f"{where}: with --wheel the build is the release; name the package alone, {asked.package}")
    if not wheels and len(asked.exact or ()) != 1:
        raise ScenarioError(f"{where}: must be one release, such as '{asked.package}==1.0', or a package with --wheel")
    return asked


def require_one_release(releases: Sequence[Release], wanted: str, option: str) -> Release:
    """Return the release if it is one: wheels may be several.

    Raises
    ------
    ScenarioError
        If there are more.
    """
    if len(releases) != 1:
        where, named = f"{option} {show_value(repr(wanted))}", ", ".join(release.label for release in releases)
        raise ScenarioError(f"{where}: must be one release, but --wheel gives {len(releases)}: {named}")
    return releases[0]


@contextmanager
def open_named_environment(
    release: Release, option: str, cache: Path, children: Children
) -> Iterator[ReleaseEnvironment]:
    """Yield the environment of a release that an option names.

    Raises
    ------
    ScenarioError
        If it cannot be installed.
    """
    try:
        with open_environment(release, cache, children) as environment:
            yield environment
    except NotInstallable as error:
        raise ScenarioError(f"{option}: {release.package} {release.label} cannot be installed here: {error}") from error
