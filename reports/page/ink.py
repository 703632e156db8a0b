"""The palette's colours on paper: the same hues, dark enough on white."""

from __future__ import annotations

from ...engines.engine import REFERENCE
from ..drawing import Colour

# WCAG 2.2, success criterion 1.4.11: the contrast of graphics with their background must be at least 3 to 1.
CONTRAST = 3.0
REFERENCE_ON_PAPER: Colour = (58, 64, 72)  # near black, as the reference's colour on a dark ground is near white
# Besides by its colour, a line is recognised by its dashes [pixels]: none for the reference, which is drawn wide, and
# for the first engine, which is drawn on it.
DASHES = ("", "8 4", "2 3", "12 3 2 3", "5 2", "12 4 2 4 2 4", "1 2", "16 5")

# A mark of a figure has one of these shapes (classes of page.css). Their number has no common factor with that of the
# dashes: dashes and shape together tell 40 engines apart without colours.
MARK_SHAPES = ("disc", "square", "diamond", "ring", "box")


def luminance(colour: Colour) -> float:
    """Return the relative luminance of an sRGB colour, 0 to 1 (WCAG 2.2)."""
    shares = [c / 255 for c in colour]
    red, green, blue = (s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def paper_colour(name: str, colour: Colour) -> Colour:
    """Return the colour of an engine on white: darkened, hue and saturation unchanged, until the contrast suffices."""
    if name == REFERENCE:
        return REFERENCE_ON_PAPER
    for share in range(100, 0, -1):
        red, green, blue = (c * share // 100 for c in colour)
        if 1.05 / (luminance((red, green, blue)) + 0.05) >= CONTRAST:
            return red, green, blue
    return (0, 0, 0)


def make_css(colour: Colour) -> str:
    """Return a colour in CSS notation."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def line_dashes(names: list[str]) -> dict[str, str]:
    """Return the dash pattern of each engine's line in SVG notation; the reference's is solid."""
    others = [name for name in names if name != REFERENCE]
    return dict.fromkeys(names, "") | {name: DASHES[k % len(DASHES)] for k, name in enumerate(others)}


def choose_mark_shapes(names: list[str]) -> dict[str, str]:
    """Return the shape of each engine's marks; the reference's is a disc."""
    others = [name for name in names if name != REFERENCE]
    return dict.fromkeys(names, MARK_SHAPES[0]) | {
        name: MARK_SHAPES[k % len(MARK_SHAPES)] for k, name in enumerate(others)
    }
