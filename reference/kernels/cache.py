"""Compiled code on disk, one file for each kernel, form and set of argument types.

numba's own cache notices that the file of a function has changed, but not the file of a function that it calls; it
keeps the names of its files in an index, which two processes that write at once can leave with the names exchanged;
and it cannot read a folder that it may not write to. Here the name of a file is a digest of all that the code
depends on, so that a file is either right or not found, files are renamed into place whole, and a package that an
administrator has installed and warmed up is read from where it is.

A kernel that is not found is locked while it is compiled: a process that needs it at the same time waits and reads it.
"""

# numba has no types, and fills its configuration in at run time.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import hashlib
import os
import pickle
import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba as nb
from numba.core import config
from numba.core.serialize import dumps

from .loading import MachineCode, Part
from .locks import unlock, wait_for_lock

_HERE = Path(__file__).parent
_PACKAGE = _HERE.parents[1]
# The kernels import one another as ``from .lean import derivative`` and ``from . import lean, rim``.
_IMPORT = re.compile(r"^from \.(\w*) import (\([^)]*\)|.*)$", re.MULTILINE)


class Folders(NamedTuple):
    """Where compiled code is read from, first to last, and where it is written, if anywhere."""

    read: tuple[Path, ...]
    write: Path | None


@cache
def find_folders(chosen: str) -> Folders:
    """Return the folders of compiled code.

    Parameters
    ----------
    chosen : str
        Folder that the user has chosen through NUMBA_CACHE_DIR; empty if none.

    Returns
    -------
    Folders
        ``kernels`` in the chosen folder; otherwise in the package, and in the user's folder of caches if the package
        cannot be written to. Code that the package brings is read in any case.
    """
    if chosen:
        candidates = [Path(chosen)]
    else:
        user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "velodrome"
        candidates = [_HERE / "__pycache__", user]
    folders: list[Path] = []
    for candidate in candidates:
        folders.append(candidate / "kernels")
        if _is_writable(folders[-1]):
            return Folders(tuple(folders), folders[-1])
    return Folders(tuple(folders), None)


def find_kernel_folder() -> Path | None:
    """Return the folder that compiled code is written to; None if nothing can be written."""
    return find_folders(config.CACHE_DIR).write  # type: ignore[attr-defined]


def find_kernel_files() -> set[str]:
    """Return the names of all files of compiled code, of these and of earlier sources."""
    folders = find_folders(config.CACHE_DIR).read  # type: ignore[attr-defined]
    return {path.name for folder in folders for path in folder.glob("*.nbc")}


def _is_writable(folder: Path) -> bool:
    """Return whether files can be written to a folder, which is made if it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


class KernelCache:
    """The compiled code of one function, in the place of numba's cache.

    Parameters
    ----------
    function : callable
        In a file that exists; see `is_cacheable`.
    form : type
        What of the code is kept.
    """

    def __init__(self, function: Callable[..., Any], form: type[MachineCode | Part]) -> None:
        self._function = function
        self._form = form
        self._chosen: str = config.CACHE_DIR  # type: ignore[attr-defined]
        self._locked: dict[str, Path] = {}

    @property
    def cache_path(self) -> str | None:
        """Folder that compiled code is written to."""
        folder = find_folders(self._chosen).write
        return None if folder is None else str(folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code for a signature; None where there is none, and it is then locked."""
        key = self._key(sig, target_context.codegen())
        name = self._file_name(key)
        folders = find_folders(self._chosen)
        data = _read(folders.read, name, key)
        if data is None and folders.write is not None:
            wait_for_lock(folders.write, name)
            self._locked[name] = folders.write
            data = _read(folders.read, name, key)  # another process may have compiled it in the meantime
            if data is not None:
                self.release()
        return None if data is None else data.load(target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write compiled code, and unlock it."""
        try:
            folder = find_folders(self._chosen).write
            if folder is not None and not data.lifted and not data.library.has_dynamic_globals:
                key = self._key(sig, data.codegen)
                _write(folder / self._file_name(key), dumps((key, self._form.take(data))))
        finally:
            self.release()

    def release(self) -> None:
        """Unlock what this function has locked, as after an error of compilation."""
        while self._locked:
            name, folder = self._locked.popitem()
            unlock(folder, name)

    def enable(self) -> None:
        """Do nothing: there is no reason to switch it off."""

    def disable(self) -> None:
        """Do nothing: there is no reason to switch it off."""

    def flush(self) -> None:
        """Do nothing: what has changed has another name."""

    def _key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        """Return what compiled code depends on besides the sources: types, CPU and what a closure encloses."""
        cells = tuple(cell.cell_contents for cell in self._function.__closure__ or ())
        code = self._function.__code__.co_code
        return sig, codegen.magic_tuple(), _digest(code), _digest(dumps(cells) if cells else b"")

    def _file_name(self, key: tuple[Any, ...]) -> str:
        function = self._function
        path = Path(function.__code__.co_filename)
        where = fingerprint(path), function.__qualname__, function.__code__.co_firstlineno, self._form.__name__
        name = re.sub(r"\W+", "_", f"{path.stem}.{function.__qualname__}.{self._form.__name__}")
        return f"{name}-{_digest(repr((where, [str(part) for part in key])).encode())[:32]}.nbc"


def is_cacheable(function: Callable[..., Any]) -> bool:
    """Return whether compiled code of a function can be kept: its sources must be in a file."""
    return Path(function.__code__.co_filename).is_file()


@cache
def fingerprint(path: Path) -> str:
    """Return a digest of the sources that the compiled code of the functions in a file depends on.

    Those are the file, the kernels that it imports, directly or through others, and numba. A file elsewhere in the
    package counts with all files beside it and all kernels, a user's file by itself with all kernels.
    """
    if path.parent == _HERE:
        sources = {path, *_find_imports(path)}
    else:
        sources = {path, *_HERE.glob("*.py")}
        if _PACKAGE in path.parents:
            sources.update(path.parent.glob("*.py"))
    digest = hashlib.sha256(nb.__version__.encode())
    for source in sorted(sources):
        digest.update(_digest(source.read_bytes()).encode())
    return digest.hexdigest()


@cache
def _find_imports(path: Path) -> frozenset[Path]:
    """Return the files beside a kernel's file that it imports, directly or through others."""
    found: set[Path] = set()
    for module, names in _IMPORT.findall(path.read_text(encoding="utf-8")):
        for name in [module] if module else re.findall(r"\w+", names):
            source = path.parent / f"{name}.py"
            if source not in found:
                found |= {source, *_find_imports(source)}
    return frozenset(found)


def _read(folders: tuple[Path, ...], name: str, key: tuple[Any, ...]) -> MachineCode | Part | None:
    """Return the code in the first folder that has it under this name and key; None if none has."""
    for folder in folders:
        try:
            found, data = pickle.loads((folder / name).read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):  # not there, or cut off as the machine went down
            continue
        if found == key:
            return data
    return None


def _write(path: Path, data: bytes) -> None:
    """Write a file whole or not at all; a full disk costs the next process the compilation."""
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            temporary = Path(file.name)
            file.write(data)
        temporary.replace(path)
    except OSError:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
