"""Rides for recordings, and recordings read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from velodrome.engines.engine import Trajectory
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.kinematics import YAW, body_positions, quaternions, rotations
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()
BOWL = Paraboloid(0.005)
SAMPLES = 201


def ride(engine: str, samples: int = SAMPLES, shift: float = 0.0, ended: str | None = None) -> Trajectory:
    """Kinematically right states of a circle, turned about the bowl's axis; forces of the right size.

    The surface has every rotation about its axis as a symmetry: turning a state turns the motion.
    """
    start, start_rate = consistent_state(BICYCLE, BOWL, (0.98620375, 2.14769555), 0.73744, 2.83701, (0.0, 0.0, 18.0))
    force = dynamics(BICYCLE, BOWL, start, start_rate).force
    time = np.arange(samples) * 0.01
    angle = start_rate[YAW] * time + shift * time
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.zeros((samples, 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = cosine, -sine, sine, cosine, 1.0
    q, qd = np.tile(start, (samples, 1)), np.tile(start_rate, (samples, 1))
    q[:, :3], qd[:, :3] = turn @ start[:3], turn @ start_rate[:3]
    q[:, YAW] += angle
    q[:, -2:] += time[:, None] * start_rate[-2:]
    seen = observe(BICYCLE, BOWL, q, qd)
    return Trajectory(
        engine=engine,
        version="1",
        settings={},
        time=time,
        q=q,
        qd=qd,
        body_position=body_positions(BICYCLE, q),
        body_quaternion=quaternions(rotations(BICYCLE, q)),
        contact_point=seen.point,
        contact_force=np.einsum("nij,wj->nwi", turn, force),
        gap=seen.gap + 1e-9,
        slip=seen.slip,
        kinetic_energy=seen.kinetic_energy * (1 + 1e-6 * time),
        potential_energy=seen.potential_energy,
        steps=samples,
        cpu_time=0.1,
        ended=ended,
    )


def flat(column: pa.Array) -> np.ndarray:
    while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    return column.to_numpy(zero_copy_only=False)


class Content:
    """All chunks of a recording: timed columns in order of time, and static ones."""

    def __init__(self, path: Path) -> None:
        self.timed: dict[tuple[str, str], list[tuple[np.ndarray, np.ndarray, pa.Array]]] = {}
        self.static: dict[tuple[str, str], pa.Array] = {}
        for chunk in RrdReader(str(path)).stream():
            batch = chunk.to_record_batch()
            for field in batch.schema:
                if (field.metadata or {}).get(b"rerun:kind") != b"data":
                    continue
                key, column = (chunk.entity_path, field.name), batch.column(field.name)
                if "time" not in chunk.timeline_names:
                    self.static[key] = column
                    continue
                index = [batch.column(name).cast(pa.int64()).to_numpy() for name in ("time", "step")]
                self.timed.setdefault(key, []).append((index[0], index[1], column))

    def entities(self) -> set[str]:
        return {entity for entity, _ in [*self.timed, *self.static]}

    def values(self, entity: str, component: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times [ns], steps and values, a row a sample."""
        parts = self.timed[entity, component]
        time, step = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        rows = np.concatenate([flat(column).reshape(len(t), -1) for t, _, column in parts])
        order = np.argsort(time, kind="stable")
        return time[order], step[order], rows[order]


class Views:
    """The layout of a recording: by the name that a view shows, what is set of it."""

    def __init__(self, path: Path) -> None:
        reader = RrdReader(str(path))
        [store] = reader.blueprints()
        self._parts: dict[str, dict[str, Any]] = {}
        for chunk in reader.stream(store=store):
            batch = chunk.to_record_batch()
            data = [field.name for field in batch.schema if (field.metadata or {}).get(b"rerun:kind") == b"data"]
            found = {name: batch.column(name).to_pylist()[-1] for name in data}
            self._parts.setdefault(chunk.entity_path, {}).update(found)
        self.paths = {
            parts["ViewBlueprint:display_name"][0]: path
            for path, parts in self._parts.items()
            if "ViewBlueprint:display_name" in parts
        }

    def properties(self, name: str, part: str = "") -> dict[str, Any]:
        """Components of a view, or of a part of it such as ``ScalarAxis``."""
        return self._parts.get(self.paths[name] + (f"/{part}" if part else ""), {})

    def get(self, name: str, component: str) -> Any:
        """The only value of a component such as ``ScalarAxis:range``; None if it is not set."""
        values = self.properties(name, component.partition(":")[0]).get(component)
        return None if values is None else values[0]

    def overridden(self, name: str, component: str) -> dict[str, Any]:
        """Values of a component that a view overrides, by entity."""
        start = f"{self.paths[name]}/ViewContents/overrides"
        return {
            path.removeprefix(start).partition("/visualizers")[0]: parts[component][0]
            for path, parts in self._parts.items()
            if path.startswith(start) and component in parts
        }
