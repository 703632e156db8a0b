"""The commands about circular motions: `circular`, `families`, `critical`, `bifurcations` and `atlas`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_engine
from .options import (
    AlphaOption,
    BicycleOption,
    ColumnsOption,
    FormatOption,
    GroundOption,
    JsonOption,
    RearTorqueOption,
    SteerDampingOption,
    SteerTorqueOption,
    TracebackOption,
    WithinOption,
    answering_missing_motion,
    ending_with,
    load_bicycle,
    make_inputs,
    parse_angles,
    parse_figure_output,
    parse_ground,
    print_json,
    print_traceback,
    show_written,
    showing_traceback,
)

_STEPS = (0.01, 0.005)  # at which engines' stable sections are measured [s]


def circular_command(
    rear_rate: Annotated[float, typer.Option(max=1e4, help="Rear-wheel rate [rad/s].")],
    alpha: AlphaOption = None,
    surface: GroundOption = None,
    family: Annotated[int | None, typer.Option(help="Solution family, 1 to 4.")] = None,
    near: Annotated[
        str | None,
        typer.Option(metavar="LEAN,STEER", help="Angles it is near to [rad]; on the plane 0,0 is straight motion."),
    ] = None,
    bicycle: BicycleOption = None,
    steer_torque: SteerTorqueOption = 0.0,
    rear_wheel_torque: RearTorqueOption = 0.0,
    steer_damping: SteerDampingOption = 0.0,
    within: WithinOption = False,
    as_json: JsonOption = False,
) -> None:
    """One circular motion: its 21 constants, contact forces, eigenvalues, verdict on stability.

    If there is no such motion, the exit status is 1; --json then gives the reason, no-such-motion or search-failed.
    """
    from .progress import COMPUTING, ProgressBars

    with answering_missing_motion(as_json), ProgressBars() as progress:
        from ..motions import search_bound, solve_circular
        from ..scenario import make_bowl

        angles, ground, source = parse_angles(near), parse_ground(alpha, surface), load_bicycle(bicycle)
        inputs = make_inputs(steer_torque, rear_wheel_torque, steer_damping)
        progress.say(COMPUTING)
        solution = solve_circular(source.bicycle, make_bowl(ground), rear_rate, family, angles, inputs)
        if within:
            progress.say("following the orbits that bound it")
            solution = search_bound(solution)
        found = solution.as_json(source.name)
    with ending_with(0):
        if as_json:
            print_json(found)
        else:
            from .present_motions import show_circular
            from .terminal import make_console

            show_circular(make_console(), found)


def families_command(
    alpha: AlphaOption = None,
    surface: GroundOption = None,
    bicycle: BicycleOption = None,
    steer_torque: SteerTorqueOption = 0.0,
    rear_wheel_torque: RearTorqueOption = 0.0,
    steer_damping: SteerDampingOption = 0.0,
    within: WithinOption = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for families.json, its page and the figure families.")
    ] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    as_json: JsonOption = False,
) -> None:
    """The four solution families by continuation: special points, stable sections."""
    from .progress import ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out")
    with answering_missing_motion(as_json), ProgressBars() as progress:
        from ..motions import follow_families, write_families
        from ..run import library_versions
        from ..scenario import make_bowl
        from .present_motions import show_families

        ground, source = parse_ground(alpha, surface), load_bicycle(bicycle)
        inputs = make_inputs(steer_torque, rear_wheel_torque, steer_damping)
        progress.say("following the curves of circular motions")
        families = follow_families(
            source.bicycle,
            make_bowl(ground),
            inputs,
            lambda done, curves: progress.watch("stability", done, curves, "curves"),
            within,
        )
        document = families.as_json(source.name)
        if out is not None:
            progress.say("writing the page and the figure")
            write_families(document, out, library_versions(), figures)
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_families(make_console(), document)


def critical_command(bicycle: BicycleOption = None, as_json: JsonOption = False) -> None:
    """The critical α: cusps collide, families merge, their last stable sections vanish."""
    from .progress import ProgressBars
    from .terminal import make_console

    with ProgressBars() as progress:
        from ..motions import MERGING, find_critical_shapes
        from .present_motions import show_critical

        source = load_bicycle(bicycle)

        def watch(stage: str, done: float, total: float) -> None:
            progress.watch(stage, done, total, "1/m" if stage == MERGING else "families")

        document = find_critical_shapes(source.bicycle, watch).as_json(source.name)
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_critical(make_console(), document)


def bifurcations_command(
    alpha: AlphaOption = None,
    surface: GroundOption = None,
    family: Annotated[int | None, typer.Option(min=1, max=4, help="Only curves with this family, 1 to 4.")] = None,
    bicycle: BicycleOption = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Measure where these engines' own stable sections end, beside the paper's method: a name, a pattern, "
            "or all; may be given several times.",
            autocompletion=complete_engine,
        ),
    ] = None,
    step: Annotated[
        list[float] | None,
        typer.Option(help="Step of the engines [s]; may be given several times. Without it 0.01 and 0.005."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for bifurcations.json and the figures.")] = None,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """Where stable circles end: Hopf points, their criticality, and the periodic orbits born there."""
    from .progress import ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns, None if out is not None else "--out")
    with answering_missing_motion(as_json), showing_traceback(traceback), ProgressBars() as progress:
        from ..error import ScenarioError
        from ..files import make_folder
        from ..motions import find_bifurcations, write_bifurcations
        from ..scenario import make_bowl
        from ..studies import configure_steps, measure_engine_ends
        from .present_bifurcations import show_bifurcations

        ground, source = parse_ground(alpha, surface), load_bicycle(bicycle)
        progress.say("following the curves of circular motions")
        if step and not engine:
            raise ScenarioError("--step is the step of engines; --engine NAME says of which")
        riders = configure_steps(engine, step or _STEPS) if engine else {}
        if out is not None:
            make_folder(out)  # first, so that no work is lost if it fails
        found = find_bifurcations(
            source.bicycle,
            make_bowl(ground),
            family,
            lambda done, points: progress.watch("orbits", done, points, "Hopf points"),
        )
        points = [one.point for one in found.found]
        ends = measure_engine_ends(points, riders, progress.watch, print_traceback if traceback else None)
        why_none = "no Hopf point here ends a stable section" if engine and not ends else None
        measured = {"engines": [end.as_json() for end in ends], "no_engines_because": why_none}
        document = {**found.as_json(source.name), **measured}
        written = [] if out is None else write_bifurcations(document, out, figures)
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_bifurcations(make_console(), document)
            show_written(written)


def atlas_command(
    out: Annotated[
        Path, typer.Option(help="Folder for atlas.parquet (some 60 MB), boundaries.json, the page and the figures.")
    ] = Path("atlas"),
    size: Annotated[int, typer.Option(help="Number of motions, roughly.")] = 400_000,
    largest: Annotated[float, typer.Option(help="Largest alpha [1/m], at most 1.")] = 1.0,
    bicycle: BicycleOption = None,
    within: Annotated[
        bool,
        typer.Option("--within", help="Search for the unstable orbits that bound stable motions, too: some minutes."),
    ] = False,
    formats: FormatOption = None,
    columns: ColumnsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Stability of all circular motions over alpha and rear rate: data, boundaries, figures (half a minute)."""
    from .progress import ProgressBars
    from .terminal import make_console

    figures = parse_figure_output(formats, columns)
    with answering_missing_motion(as_json), ProgressBars() as progress:
        from ..motions import make_atlas
        from ..run import library_versions
        from .present_motions import show_atlas

        source = load_bicycle(bicycle)
        document = make_atlas(
            source,
            out,
            library_versions(),
            size,
            largest,
            lambda done: progress.watch("atlas", done * size, size, "motions"),
            figures,
            within,
        )
    with ending_with(0):
        if as_json:
            print_json(document)
        else:
            show_atlas(make_console(), document, out)
