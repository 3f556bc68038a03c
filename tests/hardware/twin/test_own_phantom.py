"""A bench's own phantom: from a mask, an outline, a table; its errors, its file, and how the twin sees it."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest

from core import geometry
from core.bench.bench import bench_from_pictures, read_bench, with_vessel, write_bench
from core.bench.robot_texture import RobotTexture, write_textures
from core.config.calibration import CalibrationConfig, PortConfig, ScaleConfig
from core.config.models import Config
from core.types import Mask
from hardware.twin.own_phantom import (
    PhantomError,
    filled,
    mask_of_csv,
    own_phantoms,
    phantom_for_bench,
    phantom_name,
    phantom_of_mask,
    read_phantom,
    view_of_scale,
    with_own_perception,
    with_own_phantom,
    write_phantom,
)
from hardware.twin.phantom import BOARD_MM
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import Appearance, make_view, named_appearance
from hardware.twin.rendering.renderer import Renderer

SIZE = (640, 480)
SCALE = ScaleConfig(mm_per_px=0.25, size_px=SIZE, method="two clicks", uncertainty_share=0.0)
VIEW = view_of_scale(SCALE, SIZE)


def drawn(*lines: list[tuple[int, int]], width: int = 40) -> Mask:
    mask = np.zeros(SIZE[::-1], np.uint8)
    cv2.polylines(mask, [np.array(line) for line in lines], False, [1], width)
    return mask > 0


TRUNK, BRANCH = [(0, 240), (560, 240)], [(250, 240), (420, 400)]


def test_a_branched_vessel_becomes_a_phantom_in_millimetres() -> None:
    made = phantom_of_mask(drawn(TRUNK, BRANCH), VIEW, "bench:x", "Mine")
    phantom = made.phantom
    assert (len(phantom.targets), made.notes) == (2, ())
    x, y = VIEW.project(phantom.graph.nodes[phantom.port][None])[0]
    assert x < 0 and abs(y - 240) < 1.5  # the port: it enters at the border, from outside
    away = [geometry.nearest(np.array(TRUNK, float), tuple(p))[0] for e in phantom.graph.edges for p in VIEW.project(e.points)]
    assert np.median(away) < 1.0
    trunk = max(phantom.graph.edges, key=lambda edge: len(edge.points))
    assert np.median(trunk.radius) == pytest.approx(5.0, rel=0.08)
    assert max(np.linalg.norm(np.diff(edge.points, axis=0), axis=1).max() for edge in phantom.graph.edges) < 0.5
    right = max(VIEW.project(e.points)[:, 0].max() for e in phantom.graph.edges)
    assert right == pytest.approx(560, abs=4)  # the polyline's round end reaches 580


def test_the_port_may_be_given() -> None:
    phantom = phantom_of_mask(drawn(TRUNK, BRANCH), VIEW, "bench:x", "Mine", (420.0, 410.0)).phantom
    assert np.linalg.norm(VIEW.project(phantom.graph.nodes[phantom.port][None])[0] - (420, 400)) < 10


def test_an_outline_is_filled_without_its_islands() -> None:
    lumen = drawn([(100, 240), (300, 100), (500, 240), (300, 380), (100, 240)], [(0, 240), (100, 240)])
    contours, _ = cv2.findContours(lumen.view(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    lines = np.zeros(SIZE[::-1], np.uint8)
    cv2.drawContours(lines, contours, -1, [1], 2)
    both = filled(lines > 0) & lumen
    assert both.sum() > 0.95 * lumen.sum() and not filled(lines > 0)[240, 300]
    assert filled(lumen) is lumen


def broken_outline() -> Mask:
    lines = np.zeros(SIZE[::-1], np.uint8)
    cv2.rectangle(lines, (50, 200), (500, 260), [1], 2)
    lines[190:270, 300:310] = 0
    return lines > 0


@pytest.mark.parametrize(
    ("mask", "why"),
    [
        (drawn(), "no centerline"),
        (drawn([(0, 240), (300, 240)], [(350, 240), (600, 240)]), r"gap at \(3\d\d, 240\)"),
        (drawn(TRUNK, width=7), "wider than the lumen"),
    ],
)
def test_what_is_wrong_is_one_line(mask: Mask, why: str) -> None:
    with pytest.raises(PhantomError, match=why):
        phantom_of_mask(mask, VIEW, "bench:x", "Mine")


def test_a_gap_in_an_outline_is_named() -> None:
    with pytest.raises(PhantomError, match=r"outline has a gap at \("):
        filled(broken_outline())


def test_a_narrow_end_and_a_piece_far_away_are_noted() -> None:
    mask = drawn(TRUNK) | drawn(BRANCH, width=7) | drawn([(20, 60), (200, 60)], width=20)
    notes = phantom_of_mask(mask, VIEW, "bench:x", "Mine").notes
    assert len(notes) == 2 and "left out" in notes[0] and "out of reach" in notes[1]


def test_a_table_of_centerlines(tmp_path: Path) -> None:
    table = tmp_path / "lines.csv"
    table.write_text("line,x_mm,y_mm,radius_mm\na,0,50,5\na,120,50,5\nb,60,50,4\nb,100,90,4\n")
    mask, scale = mask_of_csv(table, None)
    assert scale is not None
    phantom = phantom_of_mask(mask, view_of_scale(scale, mask.shape[::-1]), "bench:x", "Table").phantom
    trunk = max(phantom.graph.edges, key=lambda edge: edge.radius.max())
    assert len(phantom.targets) == 2 and np.median(trunk.radius) == pytest.approx(5.0, rel=0.08)
    table.write_text("line,x_mm,y_mm\na,0,50\n")
    with pytest.raises(PhantomError, match="columns line, x_mm, y_mm, radius_mm"):
        mask_of_csv(table, None)


def test_it_is_kept_with_its_bench_and_seen_as_the_bench_is(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(140, 150, (*SIZE[::-1], 3), np.uint8)
    folder = tmp_path / "bench"
    write_bench(bench_from_pictures([picture], drawn(TRUNK), "Mine", 640), folder)
    with pytest.raises(PhantomError, match="has no phantom yet"):
        phantom_name(str(folder))
    write_phantom(phantom_of_mask(drawn(TRUNK), VIEW, f"bench:{folder}", "Mine").phantom, folder)
    phantom = make_phantom(name := phantom_name(str(folder)))
    assert own_phantoms(name, None) == [(name, "Mine")]
    view = make_view(Appearance(), (320, 240), phantom)
    middle = view.project(np.array([BOARD_MM]) / 2)[0]
    assert middle == pytest.approx([159.5, 119.5]) and view.pixels_per_mm((100, 75)) == pytest.approx(2.0)
    perceived = with_own_perception(Config(), str(folder)).perception
    assert (perceived.bench, perceived.segmentation.model) == (str(folder), "default")
    (tmp_path / "model.json").write_text("{}")
    drawn_in_tank = Config.model_validate({"twin": {"look": "tank"}})
    for place in (str(folder), str(tmp_path)):
        taught = with_own_perception(drawn_in_tank, place)
        perceived = taught.perception
        assert (perceived.bench, perceived.segmentation.model, taught.twin.look) == (str(folder), str(tmp_path), "own")
    known = Config.model_validate({"perception": {"bench": "other"}})
    assert with_own_perception(known, str(folder)).perception == known.perception, "a bench that is configured stays"
    config = with_own_phantom(Config(), str(folder))
    assert (config.twin.phantom, config.policy.pursuit.pixels_per_mm) == (name, pytest.approx(4.0))
    assert config.twin.look == "own"
    renderer = Renderer(phantom, named_appearance("own", 0), SIZE)
    empty, noise = renderer.render(None).image.astype(float), float(np.median(read_bench(folder).noise))
    assert np.abs(empty - picture).mean() < 2.0 * noise
    seen = renderer.render(VIEW.unproject(np.array([(0.0, 240.0), (300.0, 240.0)])))
    assert seen.robot[240, 150] and seen.image[235:246, 50:250].mean() < 0.8 * picture.mean()
    rgba = np.zeros((100, 41, 4), np.uint8)
    rgba[:, 12:29], rgba[:20, :, 0] = (0, 200, 0, 255), 250  # green, as wide as the robot; its head yellow
    write_textures([RobotTexture(rgba, 6.0, (0.0, 240.0))], folder)
    renderer = Renderer(phantom, named_appearance("own", 0), SIZE)
    assert np.abs(renderer.render(None).image.astype(float) - picture).mean() < 2.0 * noise
    seen = renderer.render(VIEW.unproject(np.array([(0.0, 240.0), (300.0, 240.0)])))
    assert seen.robot[:, 150].sum() == pytest.approx(12, abs=1)
    red, green, _ = seen.image[236:245].astype(float).mean(axis=0).T
    assert red[285:295].mean() > 2 * red[20:270].mean() and green[20:295].min() > 150
    line = np.array([(x, 240.0, 0.0 if 150 <= x < 170 else 1.0) for x in range(250)], np.float32)
    write_textures([RobotTexture(rgba, 6.0, (0.0, 240.0), line)] * 2, folder)  # a clip, in both frames
    renderer = Renderer(phantom, named_appearance("own", 0), SIZE)
    empty = renderer.render(None).image.astype(float)
    seen = renderer.render(VIEW.unproject(np.array([(0.0, 240.0), (300.0, 240.0)])))
    apart = np.abs(seen.image - empty)[236:245].mean(axis=(0, 2))
    assert np.abs(empty - picture).mean() < 2.0 * noise and apart[153:167].max() < 5.0
    assert seen.robot[240, 160] and apart[[120, 140, 180, 200]].min() > 20.0
    (folder / "phantom.json").write_text("{}")
    with pytest.raises(ValueError, match="damaged"):
        read_phantom(name)


def test_a_bench_gets_its_phantom_and_keeps_or_renews_it(tmp_path: Path) -> None:
    folder, name = tmp_path / "bench", f"bench:{tmp_path / 'bench'}"
    picture = np.random.default_rng(1).integers(90, 160, (*SIZE[::-1], 3), np.uint8)
    bench = bench_from_pictures([picture], drawn(TRUNK, BRANCH), "Mine", 640)
    write_bench(bench, folder)
    assert phantom_for_bench(folder, None) == (
        "the twin has no phantom of this bench: calibrate the rig, or say how much the picture shows: "
        f"python main.py phantom {folder} --width-mm MM"
    )
    port = PortConfig(x_share=420 / 639, y_share=410 / 479)
    known = CalibrationConfig(made_utc=datetime(2026, 1, 1, tzinfo=UTC), scale=SCALE, port=port)
    assert phantom_for_bench(folder, known) == f"the twin has a phantom of this bench: gui --bench {folder}"
    first = read_phantom(name)
    write_bench(bench, folder)
    assert len(read_phantom(name).targets) == len(first.targets) == 2
    write_bench(with_vessel(bench, drawn([(250, 60), (250, 240)], TRUNK, BRANCH)), folder)
    phantom_for_bench(folder, None)
    again = read_phantom(name)
    assert len(again.targets) == 3
    assert np.linalg.norm(again.graph.nodes[again.port] - first.graph.nodes[first.port]) < 2.0
    (folder / "phantom.json").unlink()
    write_textures([RobotTexture(np.zeros((100, 41, 4), np.uint8), 6.0, (250.0, 50.0))], folder)
    phantom_for_bench(folder, known.model_copy(update={"port": None}))  # it enters where the robot was seen to enter
    seen = read_phantom(name)
    assert VIEW.project(seen.graph.nodes[seen.port][None])[0] == pytest.approx((250, 60), abs=10)
    write_bench(with_vessel(bench, drawn([(100, 240), (200, 240)], [(270, 240), (370, 240)])), folder)
    assert phantom_for_bench(folder, known).startswith("the twin's phantom of this bench stays as it was: the vessel has a gap")
    assert len(read_phantom(name).targets) == 3
