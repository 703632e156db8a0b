"""The commands about circular motions: `circular`, `families`, `critical` and `atlas`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import (
    STARTING,
    AlphaOption,
    GroundOption,
    JsonOption,
    RearTorqueOption,
    SteerDampingOption,
    SteerTorqueOption,
    ending_with,
    make_inputs,
    parse_angles,
    parse_ground,
    print_json,
)


def circular_command(
    rear_rate: Annotated[float, typer.Option(max=1e4, help="Rear-wheel rate [rad/s].")],
    alpha: AlphaOption = None,
    surface: GroundOption = None,
    family: Annotated[int | None, typer.Option(help="Solution family, 1 to 4.")] = None,
    near: Annotated[str | None, typer.Option(metavar="LEAN,STEER", help="Angles it is near to [rad].")] = None,
    steer_torque: SteerTorqueOption = 0.0,
    rear_wheel_torque: RearTorqueOption = 0.0,
    steer_damping: SteerDampingOption = 0.0,
    as_json: JsonOption = False,
) -> None:
    """One circular motion: its 21 constants, contact forces, eigenvalues, verdict on stability."""
    from rich.console import Console

    from ...reference.bicycle import Bicycle
    from ..motions import solve_circular
    from ..scenario import make_bowl
    from .present_motions import show_circular
    from .progress import show_working

    angles, ground = parse_angles(near), parse_ground(alpha, surface)
    inputs = make_inputs(steer_torque, rear_wheel_torque, steer_damping)
    with show_working(STARTING):
        found = solve_circular(Bicycle(), make_bowl(ground), rear_rate, family, angles, inputs).as_json()
    with ending_with(0):
        if as_json:
            print_json(found)
        else:
            show_circular(Console(), found)


def families_command(
    alpha: AlphaOption = None,
    surface: GroundOption = None,
    steer_torque: SteerTorqueOption = 0.0,
    rear_wheel_torque: RearTorqueOption = 0.0,
    steer_damping: SteerDampingOption = 0.0,
    out: Annotated[Path | None, typer.Option(help="Folder for families.json and the figure families.png.")] = None,
    as_json: JsonOption = False,
) -> None:
    """The four solution families by continuation: special points, stable sections."""
    from rich.console import Console

    from ..motions import families_document, write_families
    from .present_motions import show_families
    from .progress import show_working

    ground = parse_ground(alpha, surface)
    inputs = make_inputs(steer_torque, rear_wheel_torque, steer_damping)
    with show_working(STARTING):
        document = families_document(ground, inputs)
    if out is not None:
        write_families(document, out)
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_families(Console(), document)


def critical_command(as_json: JsonOption = False) -> None:
    """The critical α: cusps collide, families merge, their last stable sections vanish."""
    from rich.console import Console

    from ...reference.bicycle import Bicycle
    from ..motions import find_critical_shapes
    from .present_motions import show_critical
    from .progress import ProgressBars

    with ProgressBars() as progress:
        document = find_critical_shapes(Bicycle(), progress.watch).as_json()
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_critical(Console(), document)


def atlas_command(
    out: Annotated[
        Path, typer.Option(help="Folder for atlas.parquet (some 60 MB), boundaries.json and the figures.")
    ] = Path("atlas"),
    size: Annotated[int, typer.Option(help="Number of motions, roughly.")] = 400_000,
    largest: Annotated[float, typer.Option(help="Largest alpha [1/m], at most 1.")] = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Stability of all circular motions over alpha and rear rate: data, boundaries, figures (half a minute)."""
    from rich.console import Console

    from ..motions import make_atlas
    from .present_motions import show_atlas
    from .progress import ProgressBars

    with ProgressBars() as progress:
        document = make_atlas(out, size, largest, lambda done: progress.watch("atlas", done, 1.0))
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_atlas(Console(), document, out)
