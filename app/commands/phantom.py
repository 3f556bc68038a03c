"""``phantom``: a bench's own phantom for the twin, from its vessel, an outline, an SVG drawing, or a table of centerlines."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from xml.etree import ElementTree

import typer

from app.commands.options import JsonOption, point_option
from app.commands.progress import console
from core.config.calibration import ScaleConfig
from core.config.rig_file import find_rig, has_rig
from core.devices import UserError
from hardware.twin.phantom import OWN

if TYPE_CHECKING:
    from core.types import Mask

_UNITS_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6}
_WHITE = 192
"""A channel below this level is drawn; paper is brighter."""


def phantom(
    bench: Annotated[str, typer.Argument(metavar="BENCH", help="folder of a bench or taught model, or a rig; or a new folder")],
    picture: Annotated[
        Path | None, typer.Option(help="picture of the empty bench: a new bench is made of it, with --outline")
    ] = None,
    outline: Annotated[Path | None, typer.Option(help="mask of the lumen, white, or its outline in thin closed lines")] = None,
    svg: Annotated[Path | None, typer.Option(help="drawing: lumen filled, its outline, or strokes as wide as the lumen")] = None,
    table: Annotated[Path | None, typer.Option("--csv", help="centerlines: line, x_mm, y_mm, radius_mm (or ..._px)")] = None,
    rig: Annotated[
        str | None, typer.Option(help="rig whose calibration gives scale and insertion port; default: BENCH, if a rig")
    ] = None,
    width_mm: Annotated[
        float | None, typer.Option(min=1.0, max=10_000.0, help="width of what the picture shows, if not calibrated")
    ] = None,
    port: Annotated[
        str | None,
        typer.Option(help="X,Y: where the robot enters, in pixels of the picture; default: as in teach, or at its border"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Make the twin's phantom of your own bench, kept in the bench's folder, for --bench of gui, trial, synth, rehearse."""
    from core.bench.robot_texture import entry_of, read_textures
    from hardware.twin.own_phantom import (
        PhantomError,
        filled,
        mask_of_csv,
        phantom_of_mask,
        scale_and_port,
        view_of_scale,
        write_phantom,
    )

    if sum(one is not None for one in (outline, svg, table)) > 1 or (picture is not None and outline is None):
        raise UserError("give one of --outline, --svg and --csv; --picture goes with --outline")
    folder, size, title, vessel = _bench(bench, picture, outline, is_drawn=svg is not None or table is not None)
    rig = rig or (bench if has_rig(bench) else None)
    known = find_rig(rig)[1].calibration if rig is not None and size is not None else None
    scale, port_px = scale_and_port(known, size or (1, 1))
    if svg is not None:
        vessel, drawn = mask_of_svg(svg, size)
        scale = scale or drawn
    elif table is not None:
        vessel, drawn = mask_of_csv(table, size)
        scale = drawn or scale
    if vessel is None:
        raise PhantomError(f"{folder}: its vessel was not drawn; give --outline MASK, --svg or --csv")
    height, width = vessel.shape
    if width_mm is not None:
        scale = ScaleConfig(mm_per_px=width_mm / width, size_px=(width, height), method="two clicks", uncertainty_share=0.0)
    if scale is None:
        raise PhantomError(
            "no scale: calibrate the rig and name it with --rig, or give --width-mm, the width that the picture shows"
        )
    made = phantom_of_mask(
        filled(vessel),
        view_of_scale(scale, (width, height)),
        f"{OWN}{folder}",
        title,
        point_option(port) if port is not None else port_px or entry_of(read_textures(folder)),
    )
    write_phantom(made.phantom, folder)
    graph, view = made.phantom.graph, made.phantom.view
    assert view is not None
    x, y = view.project(graph.nodes[made.phantom.port : made.phantom.port + 1])[0].tolist()
    diameters = [2 * float(value) for edge in graph.edges for value in edge.radius]
    low, high, ends = min(diameters), max(diameters), len(made.phantom.targets)
    for note in made.notes:
        sys.stderr.write(f"note: {note}\n")
    if as_json:
        about = {"bench": str(folder), "targets": ends, "diameter_mm": [round(low, 2), round(high, 2)]}
        about |= {"port_xy": [round(x, 1), round(y, 1)], "notes": list(made.notes)}
        sys.stdout.write(json.dumps(about, allow_nan=False) + "\n")
        return
    console.print(
        f"phantom of {title}: {ends} ends, lumen {low:.1f} to {high:.1f} mm, port at ({x:.0f}, {y:.0f}); "
        f"python main.py gui --bench {bench} shows it",
        soft_wrap=True,
    )


def _bench(
    bench: str, picture: Path | None, outline: Path | None, *, is_drawn: bool
) -> tuple[Path, tuple[int, int] | None, str, Mask | None]:
    """Folder, size of its picture, title and vessel of the bench, which is made if there is a picture."""
    from core.bench.bench import INFO, bench_from_pictures, read_bench, with_vessel, write_bench
    from core.files import name_of, read_image
    from core.learning.dataset import WORKING_SIZE_PX, read_mask
    from hardware.twin.own_phantom import PhantomError, bench_folder, filled

    mask = filled(read_mask(outline)) if outline is not None else None
    if picture is not None:
        folder = Path(bench).resolve()
        write_bench(bench_from_pictures([read_image(picture)], mask, name_of(folder), WORKING_SIZE_PX), folder)
    else:
        try:
            folder = bench_folder(bench)
        except PhantomError:
            if mask is None and not is_drawn:
                raise
            folder = Path(bench).resolve()
    if not (folder / INFO).is_file():
        return folder, None, name_of(folder), None if mask is None else _at_working_size(mask)
    known = read_bench(folder)
    if mask is not None:
        known = with_vessel(known, mask)
    return folder, known.size, known.name, known.vessel


def _at_working_size(mask: Mask) -> Mask:
    import numpy as np

    from core.learning.dataset import WORKING_SIZE_PX
    from core.perception.segmentation import to_working

    return np.asarray(
        to_working(np.where(mask[..., None], np.full(3, 255, np.uint8), np.uint8(0)), WORKING_SIZE_PX)[0][..., 0] > 127
    )


def mask_of_svg(path: Path, size: tuple[int, int] | None) -> tuple[Mask, ScaleConfig | None]:
    """What is drawn on the page, on a picture of `size` (width, height) or of working size; its scale where the page is in mm.

    Raises PhantomError for a file that cannot be read, or a page of another aspect than the picture.
    """
    import numpy as np
    from PySide6.QtCore import QRectF
    from PySide6.QtGui import QImage, QPainter
    from PySide6.QtSvg import QSvgRenderer

    from core.learning.dataset import WORKING_SIZE_PX
    from hardware.twin.own_phantom import PhantomError

    try:
        page_width = ElementTree.parse(path).getroot().get("width", "")
    except (OSError, ElementTree.ParseError) as error:
        raise PhantomError(f"{path}: is no SVG drawing that can be read ({error})") from None
    renderer = QSvgRenderer(str(path))
    page = renderer.viewBoxF()
    if not renderer.isValid() or page.isEmpty():
        raise PhantomError(f"{path}: is no SVG drawing that can be read")
    zoom = WORKING_SIZE_PX / max(page.width(), page.height())
    width, height = size or (round(zoom * page.width()), round(zoom * page.height()))
    if abs(page.width() * height / (page.height() * width) - 1.0) > 0.01:
        raise PhantomError(
            f"{path}: its page is {page.width():g}x{page.height():g}, the bench's picture {width}x{height}: draw on that"
        )
    image = QImage(width, height, QImage.Format.Format_RGB888)
    image.fill(0xFFFFFFFF)
    painter = QPainter(image)
    renderer.render(painter, QRectF(0, 0, width, height))
    painter.end()
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(height, image.bytesPerLine())
    mask = rows[:, : 3 * width].reshape(height, width, 3).min(axis=2) < _WHITE
    found = re.fullmatch(r"\s*([\d.]+)\s*(mm|cm|in|pt|pc)\s*", page_width)
    if found is None:
        return mask, None
    mm_per_px = float(found[1]) * _UNITS_MM[found[2]] / width
    return mask, ScaleConfig(mm_per_px=mm_per_px, size_px=(width, height), method="two clicks", uncertainty_share=0.0)
