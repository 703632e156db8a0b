"""One colour for each engine, the same in every recording and figure."""

from __future__ import annotations

import zlib
from collections.abc import Iterable

from ...engines.engine import REFERENCE

Colour = tuple[int, int, int]

REFERENCE_COLOUR: Colour = (232, 234, 238)

# Ten hues of similar lightness that are distinct on a dark background, with orange and blue first, which remain
# distinct with common colour blindness.
PALETTE: tuple[Colour, ...] = (
    (255, 140, 50),
    (70, 160, 255),
    (64, 201, 140),
    (240, 96, 146),
    (214, 160, 128),
    (178, 135, 255),
    (245, 205, 71),
    (72, 211, 219),
    (168, 214, 76),
    (224, 112, 224),
)


_SALT = "816:"  # the first of those tried that gives the suite's own engines different slots


def assign_colours(names: Iterable[str]) -> dict[str, Colour]:
    """Assign a colour to each engine name.

    The reference is near white. Every other name gets the slot of its checksum, or the next free one,
    so that an engine has the same colour whatever other engines run, unless two names collide. When all slots are
    taken, further engines get paler colours of the same hues, and after these the first ones once more.

    Parameters
    ----------
    names : iterable of str
        Engine names; in a collision the first one keeps its slot.

    Returns
    -------
    dict of str to tuple of int
        Red, green, blue, 0 to 255.
    """
    assigned: dict[str, Colour] = {}
    taken: set[int] = set()
    shades = (PALETTE, tuple(_make_paler(colour) for colour in PALETTE))
    rounds = 0
    for name in names:
        if name == REFERENCE:
            assigned[name] = REFERENCE_COLOUR
            continue
        if len(taken) == len(PALETTE):
            taken.clear()
            rounds += 1
        slot = zlib.crc32(f"{_SALT}{name}".encode()) % len(PALETTE)
        while slot in taken:
            slot = (slot + 1) % len(PALETTE)
        taken.add(slot)
        assigned[name] = shades[rounds % len(shades)][slot]
    return assigned


def _make_paler(colour: Colour) -> Colour:
    """Return the colour halfway to white."""
    red, green, blue = ((255 + c) // 2 for c in colour)
    return red, green, blue
