"""A phantom of the user's own bench: from the mask of its lumen, in millimetres by the bench's scale; kept in the bench's folder.

The mask is the bench's vessel, a drawing, or centerlines with radii; all take the same way as perception: skeleton, graph, radii.
The picture's middle lies in the middle of the board, and the twin's camera sees the phantom as the bench's does.
"""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from core import geometry
from core.bench.bench import INFO, PHANTOM_FILE, read_bench
from core.bench.robot_texture import entry_of, read_textures
from core.config.calibration import CalibrationConfig, ScaleConfig
from core.config.models import CleaningConfig, Config
from core.config.rig_file import RigFile, find_rig, has_rig, list_rigs
from core.config.section import first_problem
from core.devices import UserError, disk_errors
from core.files import write_atomic
from core.learning.dataset import WORKING_SIZE_PX
from core.messages import message
from core.perception.model_file import BENCH, own_models
from core.perception.model_file import INFO as MODEL_INFO
from core.perception.segmentation import clean_mask
from core.perception.skeleton import end_pixels, thin
from core.perception.vessel_graph import build_graph
from core.types import GraphEdge, Mask, Point, Points, VesselGraph
from hardware.twin.catalog import OWN_LOOK
from hardware.twin.phantom import BOARD_MM, OWN, Phantom, own_file
from hardware.twin.view import CameraView

ROBOT_MM = 2.5
"""Diameter of the twin's robot (``hardware/twin/physics.py``)."""
_FORMAT = 1
_SPACING_MM, _LEAST_POINTS = 0.4, 6
"""Spacing of an edge's points, and their least number: the port's direction is taken over five steps."""
_LINE_PX = 2.5
"""A drawing whose strokes have a smaller median half width is an outline, or centerlines without a width."""
_GAP_RADII = 4.0
"""Ends of two pieces of vessel that are nearer than so many radii belong together: there is a gap in the outline."""
_BORDER_PX = 4.0
"""An end this near to the picture's border runs out of it."""
_END_POINTS = 30
"""So many points, 2 px apart, tell the width at a vessel's end."""
_FULL_WIDTH = 0.9
"""Where a vessel ends within the picture, its centerline ends at this share of its width, so that the rounded end fits into it."""


class PhantomError(UserError, ValueError):
    """A phantom cannot be made or read; one line says what to do."""


class _Edge(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    start: int = Field(ge=0)
    end: int = Field(ge=0)
    points_mm: list[tuple[float, float]] = Field(min_length=_LEAST_POINTS)
    radius_mm: list[float]


class _PhantomFile(BaseModel):
    """``phantom.json``; ``view`` maps board mm to pixels of a picture of ``size_px`` (3x3, row by row)."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    format: int = Field(_FORMAT, ge=1, le=_FORMAT)
    title: str = Field(max_length=200)
    port: int = Field(ge=0)
    size_px: tuple[int, int]
    view: list[float] = Field(min_length=9, max_length=9)
    nodes_mm: list[tuple[float, float]]
    edges: list[_Edge] = Field(min_length=1)


def bench_folder(name: str) -> Path:
    """The folder of a bench: itself, or that of a taught model (folder or name) or of a rig. Raises PhantomError."""
    places = [Path(name), Path(name) / BENCH, own_models() / name / BENCH]
    if has_rig(name):
        path, rig = find_rig(name)
        places += [path.parent / rig.bench] if rig.bench is not None else []
    for place in places:
        if (place / INFO).is_file() or (place / PHANTOM_FILE).is_file():
            return place.resolve()
    raise PhantomError(
        f"{name}: no bench there; give the folder of a bench or of a taught model, or the name of a rig that has one"
    )


def phantom_name(bench: str) -> str:
    """The twin's name of the phantom of a bench, by folder, taught model or rig. Raises PhantomError where it has none."""
    folder = bench_folder(bench)
    if not (folder / PHANTOM_FILE).is_file():
        raise PhantomError(f"{folder}: has no phantom yet; make it with: python main.py phantom {bench}")
    return f"{OWN}{folder}"


def with_own_phantom(config: Config, bench: str) -> Config:
    """The configuration with the twin in the phantom of a bench, seen at the size and scale of its picture, in that picture.

    A look that is configured stays. The robot behaves, and pursuit is tuned, as the bench's rig file says. Raises PhantomError.
    """
    name = phantom_name(bench)
    view = read_phantom(name).view
    assert view is not None
    (width, height), working = view.size, config.perception.working_size_px
    twin: dict[str, Any] = {"phantom": name, "image_width_px": max(width, 160), "image_height_px": max(height, 120)}
    rig = _rig_of(bench)
    if rig is not None and rig.behaviour is not None:
        twin["behaviour"] = rig.behaviour
    if config.twin.look is None and not config.twin.appearance_seed:
        twin["look"] = OWN_LOOK
    zoom = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2)) * working / max(view.size)
    pursuit = config.policy.pursuit.model_copy(update={"pixels_per_mm": zoom} | (rig.pursuit or {} if rig is not None else {}))
    policy = config.policy.model_copy(update={"pursuit": pursuit})
    return config.model_copy(update={"twin": config.twin.model_copy(update=twin), "policy": policy})


def with_own_perception(config: Config, bench: str) -> Config:
    """The configuration as it is at a bench: it is known, with the model that was taught on it, and the twin has its look.

    A bench that is configured stays, with its model. Raises PhantomError.
    """
    folder, rig, perception = bench_folder(bench), _rig_of(bench), config.perception
    if perception.bench is None and (folder / INFO).is_file():
        taught = str(folder.parent) if folder.name == BENCH and (folder.parent / MODEL_INFO).is_file() else None
        model = (rig.model if rig is not None else None) or taught or perception.segmentation.model
        segmentation = perception.segmentation.model_copy(update={"model": model})
        perception = perception.model_copy(update={"bench": str(folder), "segmentation": segmentation})
    return config.model_copy(update={"perception": perception, "twin": config.twin.model_copy(update={"look": OWN_LOOK})})


def _rig_of(bench: str) -> RigFile | None:
    """The rig of this name, else the first one that has this bench."""
    if has_rig(bench):
        return find_rig(bench)[1]
    folder = bench_folder(bench)
    rigs = ((one.path.parent, one.rig) for one in list_rigs())
    return next((rig for place, rig in rigs if rig and rig.bench and (place / rig.bench).resolve() == folder), None)


def view_of_scale(scale: ScaleConfig, size: tuple[int, int]) -> CameraView:
    """The view of a bench's picture of `size` (width, height), with its middle in the middle of the board."""
    plane = np.diag([scale.mm_per_px, scale.mm_per_px, 1.0]) if scale.plane is None else np.array(scale.plane).reshape(3, 3)
    view = CameraView(np.linalg.inv(plane), scale.size_px).fitted(size)
    middle = view.unproject(np.array([[(size[0] - 1) / 2, (size[1] - 1) / 2]]))[0]
    shift = np.eye(3)
    shift[:2, 2] = middle - np.array(BOARD_MM) / 2
    return CameraView(view.homography @ shift, size)


def scale_and_port(known: CalibrationConfig | None, size: tuple[int, int]) -> tuple[ScaleConfig | None, Point | None]:
    """What a calibration says of pictures of `size` (width, height); None where it says nothing."""
    if known is None:
        return None, None
    scale = known.scale if known.scale is not None and known.scale.fits(size) else None
    port = known.port
    return scale, None if port is None else (port.x_share * (size[0] - 1), port.y_share * (size[1] - 1))


def phantom_for_bench(folder: Path, known: CalibrationConfig | None) -> str:
    """Make the phantom of a bench's vessel, or make it again: by a calibration, else by scale and port of the one before.

    Returns a line that says what was made, or why not and what to do: the one before stays then. Raises nothing.
    """
    has_one = (folder / PHANTOM_FILE).is_file()
    try:
        bench, before = read_bench(folder), None
        with contextlib.suppress(PhantomError):  # a damaged one is made again
            before = read_phantom(f"{OWN}{folder}") if has_one else None
        scale, port_px = scale_and_port(known, bench.size)
        view = view_of_scale(scale, bench.size) if scale is not None else None
        if before is not None and before.view is not None and before.view.size == bench.size:
            view = view or before.view
            x, y = before.view.project(before.graph.nodes[before.port][None])[0].tolist()
            port_px = port_px or (x, y)
        port_px = port_px or entry_of(read_textures(folder))
        if view is None or bench.vessel is None:
            why = message(
                "calibrate the rig, or say how much the picture shows: python main.py phantom {folder} --width-mm MM", folder=folder
            )
            raise PhantomError(why)
        made = phantom_of_mask(bench.vessel, view, f"{OWN}{folder}", bench.name, port_px).phantom
        write_phantom(made, folder)
    except (UserError, ArithmeticError, LookupError, ValueError) as error:
        if has_one:
            return message("the twin's phantom of this bench stays as it was: {why}", why=error)
        return message("the twin has no phantom of this bench: {why}", why=error)
    return message("the twin has a phantom of this bench: gui --bench {folder}", folder=folder)


def filled(ink: Mask) -> Mask:
    """A drawing (h, w) as a mask of the lumen: an outline of thin lines is filled, its islands are not.

    Raises PhantomError for thin lines that enclose nothing.
    """
    lines = thin(ink)
    if not lines.any():
        raise PhantomError("the drawing is empty: draw the lumen filled, its outline, or strokes as wide as the lumen")
    half_px = cv2.distanceTransform(ink.view(np.uint8), cv2.DIST_L2, 5)
    if (half := float(np.median(half_px[lines]))) >= _LINE_PX:
        return ink
    contours, tree = cv2.findContours(ink.view(np.uint8), cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE)
    lumen = np.zeros(ink.shape, np.uint8)
    parents = tree[0, :, 3].tolist()
    depths = [_depth(parents, number) for number in range(len(contours))]
    for number in sorted(range(len(contours)), key=depths.__getitem__):  # lines 0, lumen 1, lines 2, island 3, lines 4, ...
        if (depth := depths[number] % 4) in (1, 2):
            cv2.drawContours(lumen, contours, number, [2 - depth], cv2.FILLED)
    if lumen.sum() < ink.sum():
        open_ends = end_pixels(lines)
        where = f" at ({open_ends[0][0]}, {open_ends[0][1]})" if open_ends else ""
        raise PhantomError(f"the outline has a gap{where}: close it, draw the lumen filled, or strokes as wide as the lumen")
    side = 2 * round(half) - 1  # up to the middle of the lines, of which the contours have one pixel
    return np.asarray(cv2.dilate(lumen, np.ones((side, side), np.uint8)) > 0)


def _depth(parents: list[int], number: int) -> int:
    """How many contours lie around one."""
    return 0 if parents[number] < 0 else 1 + _depth(parents, parents[number])


def mask_of_csv(path: Path, size: tuple[int, int] | None) -> tuple[Mask, ScaleConfig | None]:
    """The lumen drawn from centerlines with radii, and its scale where they are in millimetres.

    Columns ``line, x_mm, y_mm, radius_mm``, or ``x_px`` ... in a picture of `size`; rows of one line are consecutive. Raises
    PhantomError.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
        unit = "mm" if rows and "x_mm" in rows[0] else "px"
        names = (f"x_{unit}", f"y_{unit}", f"radius_{unit}")
        lines = [
            np.array([[float(row[name]) for name in names] for row in group]) for _, group in groupby(rows, lambda row: row["line"])
        ]
    except OSError as error:
        raise PhantomError(f"{path}: cannot be read ({error.strerror})") from None
    except (KeyError, TypeError, ValueError, csv.Error, UnicodeError):
        raise PhantomError(f"{path}: needs the columns line, x_mm, y_mm, radius_mm (or ..._px) with a number in each") from None
    values = np.concatenate([*lines, np.empty((0, 3))])
    if not len(values) or not np.isfinite(values).all() or (values[:, 2] <= 0.0).any():
        raise PhantomError(f"{path}: needs at least one line, finite places, and radii above 0")
    scale = None
    if unit == "mm" and size is not None:
        raise PhantomError(
            f"{path}: places in mm are not known in the bench's picture; give x_px, y_px, radius_px, or a new folder"
        )
    if unit == "mm":
        low = (values[:, :2] - 1.5 * values[:, 2:]).min(axis=0)
        high = (values[:, :2] + 1.5 * values[:, 2:]).max(axis=0)
        mm_per_px = float((high - low).max()) / WORKING_SIZE_PX
        width, height = np.ceil((high - low) / mm_per_px).astype(int).tolist()
        size, scale = (
            (width, height),
            ScaleConfig(mm_per_px=mm_per_px, size_px=(width, height), method="two clicks", uncertainty_share=0.0),
        )
        lines = [np.column_stack([(line[:, :2] - low) / mm_per_px, line[:, 2] / mm_per_px]) for line in lines]
    if size is None:
        raise PhantomError(f"{path}: places in px need a bench with a picture; give them in mm, or --picture")
    mask = np.zeros(size[::-1], np.uint8)
    for line in lines:
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
        places = np.union1d(np.arange(0.0, along[-1], 0.5), along)
        for x, y, radius in zip(*(np.interp(places, along, line[:, column]) for column in range(3)), strict=True):
            cv2.circle(mask, (round(256 * x), round(256 * y)), round(256 * radius), [1], cv2.FILLED, cv2.LINE_8, 8)
    return mask > 0, scale


@dataclass(frozen=True, slots=True, eq=False)
class OwnPhantom:
    """A phantom, and what is to be said of it, a line each."""

    phantom: Phantom
    notes: tuple[str, ...]


def phantom_of_mask(mask: Mask, view: CameraView, name: str, title: str, port_px: Point | None = None) -> OwnPhantom:
    """The phantom of a lumen's mask (h, w) of the size of `view`.

    The robot enters at `port_px`, in pixels of the mask; None: at the widest end at the picture's border, or the end nearest to
    it. Raises PhantomError: no vessel, a gap in it, one end only, or a robot that is wider than the lumen on every way.
    """
    cleaning = CleaningConfig()
    clean = clean_mask(mask, cleaning.min_vessel_area_px, cleaning.max_hole_area_px)
    graph = build_graph(thin(clean), clean, cleaning)
    if not graph.edges:
        raise PhantomError("no centerline is found in the vessel: white must be the lumen, and at least 10 px wide")
    pieces = _pieces(graph)
    lengths = [sum(float(geometry.arc_length(edge.points)[-1]) for edge in piece) for piece in pieces]
    chosen = int(np.argmax(lengths))
    if port_px is not None:
        chosen = int(np.argmin([min(geometry.nearest(edge.points, port_px)[0] for edge in piece) for piece in pieces]))
    notes = [_left_out(pieces[chosen], piece) for number, piece in enumerate(pieces) if number != chosen]
    lines = [_ended(edge, _degrees(pieces[chosen]), clean.shape) for edge in pieces[chosen]]
    degrees = _degrees(lines)
    sides = [
        side
        for edge in lines
        for side in ((edge.start, edge.points[0], edge.radius[0]), (edge.end, edge.points[-1], edge.radius[-1]))
    ]
    ends = {node: (place, float(radius)) for node, place, radius in sides if degrees[node] == 1}
    if len(ends) < 2:
        raise PhantomError("the vessel has one end only: the robot needs one to enter and one to go to")
    port = min(ends, key=lambda node: _rank(*ends[node], port_px, clean.shape))
    numbers = {node: place for place, node in enumerate(sorted(degrees))}
    nodes_px = graph.nodes.copy()
    for node, (place, _) in ends.items():
        nodes_px[node] = place
    nodes = view.unproject(nodes_px[sorted(degrees)])
    edges = tuple(_in_mm(edge, view, numbers, nodes) for edge in lines)
    phantom = Phantom(name, title, VesselGraph(nodes, edges), numbers[port], view)
    return OwnPhantom(phantom, (*notes, *_too_narrow(phantom)))


def _pieces(graph: VesselGraph) -> list[list[GraphEdge]]:
    """The edges of each connected part."""
    part = list(range(len(graph.nodes)))
    for edge in graph.edges:
        old, new = part[edge.start], part[edge.end]
        part = [new if one == old else one for one in part]
    return [[edge for edge in graph.edges if part[edge.start] == number] for number in sorted({part[e.start] for e in graph.edges})]


def _degrees(edges: Sequence[GraphEdge]) -> dict[int, int]:
    degrees: dict[int, int] = {}
    for edge in edges:
        for node in (edge.start, edge.end):
            degrees[node] = degrees.get(node, 0) + 1
    return degrees


def _left_out(main: Sequence[GraphEdge], other: Sequence[GraphEdge]) -> str:
    """A line about a piece of vessel that hangs together with nothing. Raises PhantomError where there is only a gap."""
    ends = np.concatenate([edge.points[[0, -1]] for edge in other])
    away = [min(geometry.nearest(edge.points, (x, y))[0] for edge in main) for x, y in ends.tolist()]
    x, y = ends[int(np.argmin(away))]
    if min(away) < _GAP_RADII * float(np.median(np.concatenate([edge.radius for edge in other]))):
        raise PhantomError(f"the vessel has a gap at ({x:.0f}, {y:.0f}): draw its lumen closed there")
    return f"a piece of vessel at ({x:.0f}, {y:.0f}) is not connected with the rest: left out"


def _ended(edge: GraphEdge, degrees: dict[int, int], shape: tuple[int, ...]) -> GraphEdge:
    """The edge with a full width at a vessel's ends: within the picture the rest is cut off, out of it the vessel goes on."""
    points, radius = edge.points, edge.radius
    for side, node in ((1, edge.end), (-1, edge.start)):
        points, radius = points[::side], radius[::side]
        if degrees[node] == 1 and len(points) > 3:
            width = float(np.median(radius[-_END_POINTS:]))
            last = max(int(np.flatnonzero(radius >= _FULL_WIDTH * width)[-1]), 1)
            if _to_border(points[-1], shape) < _BORDER_PX:
                onward = geometry.extrapolate(points, width, width)[1:]
                points = np.concatenate([points, onward])
                radius = np.concatenate([radius[: last + 1], np.full(len(points) - last - 1, radius[last])])
            else:
                points, radius = points[: last + 1], radius[: last + 1]
        points, radius = points[::side], radius[::side]
    return replace(edge, points=points, radius=radius)


def _to_border(place: NDArray[np.float64], shape: tuple[int, ...]) -> float:
    return float(min(place[0], place[1], shape[1] - 1 - place[0], shape[0] - 1 - place[1]))


def _rank(place: NDArray[np.float64], radius: float, port_px: Point | None, shape: tuple[int, ...]) -> tuple[float, float]:
    """Sorts ends by how likely the robot enters there."""
    if port_px is not None:
        return float(np.hypot(*(place - port_px))), 0.0
    return max(_to_border(place, shape), _BORDER_PX), -radius


def _in_mm(edge: GraphEdge, view: CameraView, numbers: dict[int, int], nodes: Points) -> GraphEdge:
    """The edge in board millimetres, evenly spaced, from node to node."""
    points = view.unproject(edge.points)
    radius = edge.radius / view.scales(points)
    start, end = numbers[edge.start], numbers[edge.end]
    points[0], points[-1] = nodes[start], nodes[end]
    along = geometry.arc_length(points)
    places = np.linspace(0.0, along[-1], max(_LEAST_POINTS, int(along[-1] / _SPACING_MM) + 2))
    even = np.column_stack([np.interp(places, along, points[:, axis]) for axis in (0, 1)])
    return GraphEdge(start, end, even, np.interp(places, along, radius))


def narrowest_mm(phantom: Phantom) -> dict[int, float]:
    """The least lumen diameter on the widest way from the port to each target."""
    widest = {phantom.port: np.inf}
    for _ in phantom.graph.nodes:  # as often as a way can have edges
        for edge in phantom.graph.edges:
            width = 2 * float(edge.radius.min())
            for near, far in ((edge.start, edge.end), (edge.end, edge.start)):
                if near in widest:
                    widest[far] = max(widest.get(far, 0.0), min(widest[near], width))
    return {node: float(widest[node]) for node in phantom.targets}


def _too_narrow(phantom: Phantom) -> list[str]:
    """Lines about the ends that a robot is too wide for; raises PhantomError where it is for all."""
    widths = narrowest_mm(phantom)
    narrow = {node: width for node, width in widths.items() if width < ROBOT_MM + 0.1}
    if len(narrow) == len(widths):
        widest = max(widths.values())
        raise PhantomError(
            f"the twin's robot ({ROBOT_MM} mm) is wider than the lumen ({widest:.1f} mm at its narrowest): check the scale"
        )
    assert phantom.view is not None
    places = {node: phantom.view.project(phantom.graph.nodes[node : node + 1])[0] for node in narrow}
    return [
        f"the end at ({places[node][0]:.0f}, {places[node][1]:.0f}) is out of reach: {width:.1f} mm at the narrowest place"
        for node, width in narrow.items()
    ]


def write_phantom(phantom: Phantom, folder: Path) -> None:
    """Keep a phantom with a view of its own in the folder of its bench. Raises PhantomError."""
    assert phantom.view is not None
    edges = [
        _Edge(start=one.start, end=one.end, points_mm=np.round(one.points, 3).tolist(), radius_mm=np.round(one.radius, 3).tolist())
        for one in phantom.graph.edges
    ]
    file = _PhantomFile(
        title=phantom.title,
        port=phantom.port,
        size_px=phantom.view.size,
        view=phantom.view.homography.ravel().tolist(),
        nodes_mm=np.round(phantom.graph.nodes, 3).tolist(),
        edges=edges,
    )
    with disk_errors(PhantomError, folder, "cannot be written", "; make room, or choose another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        write_atomic(folder / PHANTOM_FILE, file.model_dump_json().encode() + b"\n")


def read_phantom(name: str) -> Phantom:
    """The phantom ``bench:<folder>``. Raises PhantomError: not there, or damaged."""
    path = own_file(name)
    assert path is not None
    try:
        file = _PhantomFile.model_validate_json(path.read_bytes())
        nodes = np.array(file.nodes_mm, np.float64)
        edges = tuple(GraphEdge(e.start, e.end, np.array(e.points_mm), np.array(e.radius_mm)) for e in file.edges)
        if any(max(e.start, e.end) >= len(nodes) or len(e.points) != len(e.radius) for e in edges) or file.port >= len(nodes):
            raise PhantomError(f"{path}: damaged (nodes); make it again with: python main.py phantom")
    except OSError as error:
        raise PhantomError(f"{path}: cannot be read ({error.strerror}); make it with: python main.py phantom") from None
    except ValidationError as error:
        raise PhantomError(f"{path}: damaged ({first_problem(error)}); make it again with: python main.py phantom") from None
    view = CameraView(np.array(file.view).reshape(3, 3), file.size_px)
    return Phantom(name, file.title, VesselGraph(nodes, edges), file.port, view)


def own_phantoms(current: str, bench: str | None) -> list[tuple[str, str]]:
    """Names and titles of the phantoms of all benches that the program knows: of its own models, of rigs, and those named here."""
    folders = [path.parent for path in sorted(own_models().glob(f"*/{BENCH}/{PHANTOM_FILE}"))]
    folders += [(one.path.parent / one.rig.bench).resolve() for one in list_rigs() if one.rig is not None and one.rig.bench]
    folders += [Path(bench).resolve()] if bench is not None else []
    folders += [file.parent] if (file := own_file(current)) is not None else []
    found = {}
    for folder in dict.fromkeys(folders):
        try:
            found[f"{OWN}{folder}"] = read_phantom(f"{OWN}{folder}").title
        except PhantomError:  # told where it is chosen by name
            continue
    return list(found.items())
