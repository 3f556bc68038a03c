"""A model folder: written whole, verified by hash, never half loaded."""

import json
import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save

from core.config.models import SegmentationConfig
from core.learning.model_writer import changed, rounded, save_model, save_with_second_look, write_figures
from core.perception.inference import OpenVinoSegmenter, TorchSegmenter, open_segmenter
from core.perception.model_file import (
    INFO,
    MODELS,
    ONNX,
    SECOND_LOOK,
    WEIGHTS,
    ModelError,
    check_files,
    check_model,
    load_network,
    model_folder,
    models_in,
    read_model_info,
    sha256_of,
)
from core.perception.segmentation import to_working
from core.perception.unet import DualUNet, UNetShape, with_prior_planes

TINY = UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(1)
    folder = tmp_path_factory.mktemp("models") / "tiny"
    save_model(DualUNet(TINY).eval(), folder, training={"steps": 0}, figures={})
    return folder


@pytest.fixture
def model(saved: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(saved, tmp_path / "tiny"))


def test_both_engines_see_the_same_at_any_size(model: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (75, 101, 3), np.uint8)
    first, second = OpenVinoSegmenter(model, 1)(image), TorchSegmenter(model, 1)(image)
    for a, b in zip(first, second, strict=True):
        assert a.shape == (75, 101)
        assert a.dtype == np.float32
        np.testing.assert_allclose(a, b, atol=2e-4)


@pytest.mark.parametrize("engine", [OpenVinoSegmenter, TorchSegmenter])
@pytest.mark.parametrize("damage", ["cut", "flip", "missing", "empty"])
def test_a_damaged_file_is_one_clear_error(model: Path, engine: type, damage: str) -> None:
    path = model / ONNX
    data = bytearray(path.read_bytes())
    if damage == "missing":
        path.unlink()
    else:
        data[len(data) // 2] ^= 1
        path.write_bytes({"cut": data[: len(data) // 2], "flip": data, "empty": b""}[damage])
    with pytest.raises(ModelError, match="restore the model folder") as caught:
        engine(model, 1)
    assert ONNX in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 2}', "null", '{"format": 1, "name": "x", "extra": 1}'])
def test_a_damaged_manifest_is_one_clear_error(model: Path, text: str) -> None:
    (model / INFO).write_text(text)
    with pytest.raises(ModelError, match="damaged") as caught:
        read_model_info(model)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [ONNX, f"{SECOND_LOOK}/{ONNX}"])
def test_a_model_is_checked_whole_before_anything_begins_with_it(model: Path, tmp_path: Path, name: str) -> None:
    near = DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 5, 2)).eval()
    save_with_second_look(model, near, tmp_path / "both", training={}, figures={})
    check_model(str(tmp_path / "both"))
    file = tmp_path / "both" / name
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(ModelError, match="the file is cut or damaged"):
        check_model(str(tmp_path / "both"))


def test_what_is_being_made_is_no_model_yet(model: Path) -> None:
    shutil.copytree(model, model.with_name(".tiny-ab12"))
    assert models_in(model.parent) == [model]


def test_weights_of_another_shape_are_refused(model: Path) -> None:
    info = json.loads((model / INFO).read_text())
    info["shape"]["widths"] = [4, 4, 8, 8, 16]
    (model / INFO).write_text(json.dumps(info))
    with pytest.raises(ModelError, match="does not fit the shape"):
        load_network(model)


def test_an_unknown_model_names_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no model 'nope'"):
        model_folder("nope")
    with pytest.raises(ModelError, match="installed models"):
        model_folder(str(tmp_path))


def test_weights_survive_the_round_trip(model: Path) -> None:
    torch.manual_seed(1)
    original = rounded(DualUNet(TINY).eval()).state_dict()
    loaded, info = load_network(model)
    assert info.stride == 32
    for name, tensor in loaded.state_dict().items():
        torch.testing.assert_close(tensor, original[name])


def test_a_folder_of_format_1_has_its_weights_in_a_file_of_their_own(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    network, info = load_network(model)
    half = {name: tensor.half() if tensor.dim() > 1 else tensor for name, tensor in network.state_dict().items()}
    (model / WEIGHTS).write_bytes(save(half))
    changes = {"format": 1, "weights_sha256": sha256_of(model / WEIGHTS)}
    (model / INFO).write_text(info.model_copy(update=changes).model_dump_json())
    check_model(str(model))
    with monkeypatch.context() as without_onnx:
        for package in ("onnx", "google.protobuf.message"):
            without_onnx.setitem(sys.modules, package, None)
        old = load_network(model)[0].state_dict()
    assert all(torch.equal(old[name], tensor) for name, tensor in network.state_dict().items())
    near = with_prior_planes(network)
    save_with_second_look(model, near, tmp_path / "both", training={}, figures={})
    check_model(str(tmp_path / "both"))
    write_figures(tmp_path / "both", {"robot_dice": 0.5})
    (tmp_path / "both" / WEIGHTS).write_bytes(b"cut")
    with pytest.raises(ModelError, match=f"{WEIGHTS}: SHA-256 differs"):
        check_model(str(tmp_path / "both"))


@pytest.mark.parametrize(
    ("package", "words"),
    [
        ("onnx", "^this needs the package onnx, which is not installed: "),
        ("google.protobuf.message", "which does not load .*google.protobuf.message.*: make clean && make setup$"),
    ],
)
def test_a_package_that_does_not_load_is_one_clear_error(
    model: Path, monkeypatch: pytest.MonkeyPatch, package: str, words: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModelError, match=words):
        load_network(model)


@pytest.mark.parametrize(
    ("size", "working"), [((480, 640), (480, 640)), ((1080, 1920), (360, 640)), ((300, 200), (640, 427)), ((7, 5000), (1, 640))]
)
def test_working_size_keeps_the_aspect(size: tuple[int, int], working: tuple[int, int]) -> None:
    image, scale = to_working(np.zeros((*size, 3), np.uint8), 640)
    assert image.shape[:2] == working
    assert scale == (working[1] / size[1], working[0] / size[0])


def test_nothing_but_a_model_is_ever_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("years of work")
    with pytest.raises(ModelError, match="exists and is not a model"):
        save_model(DualUNet(TINY), tmp_path / "thesis", training={}, figures={})
    assert (tmp_path / "thesis" / "chapter.txt").read_text() == "years of work"


def test_a_model_is_replaced_whole(model: Path) -> None:
    before = read_model_info(model).weights_sha256
    torch.manual_seed(2)
    save_model(DualUNet(TINY), model, training={"steps": 9}, figures={})
    after = read_model_info(model)
    assert after.training == {"steps": 9}
    assert after.weights_sha256 != before
    assert [p.name for p in model.parent.iterdir()] == [model.name], "no scratch is left behind"


@pytest.mark.parametrize("manifest", sorted(MODELS.rglob(INFO)), ids=lambda path: path.parent.name)
def test_a_shipped_models_files_are_those_of_its_manifest(manifest: Path) -> None:
    """One that is left over from other weights would never be used, nor its absence be seen."""
    info = read_model_info(manifest.parent, verify=())
    there = {path.name for path in manifest.parent.iterdir() if path.is_file()}
    assert there == {INFO, *info.files}
    check_files(info, manifest.parent, sorted(there - {INFO}))
    assert all(path.stat().st_size <= 12_000_000 for path in manifest.parent.iterdir() if path.is_file())


def test_what_else_lies_in_a_models_folder_outlives_the_model(model: Path) -> None:
    (model / "frames" / "images").mkdir(parents=True)
    (model / "frames" / "images" / "a.png").write_bytes(b"drawn by hand")
    (model / SECOND_LOOK).mkdir()
    (model / SECOND_LOOK / "NOTES.md").write_text("mine")
    with changed(model) as work:
        write_figures(work, {"new": 1})
    save_model(DualUNet(TINY).eval(), model, training={"steps": 1}, figures={})
    assert read_model_info(model).training == {"steps": 1}
    assert (model / "frames" / "images" / "a.png").read_bytes() == b"drawn by hand"
    assert (model / SECOND_LOOK / "NOTES.md").read_text() == "mine"
    assert [path.name for path in model.parent.iterdir()] == [model.name]


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit of a file's size")
def test_a_full_disk_is_one_clear_error_and_the_old_model_stays(model: Path) -> None:
    import resource

    before, limits = (model / ONNX).read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(ModelError, match=r"tiny: cannot be written \(.*too large.*\); make room, or choose another folder"):
            save_model(DualUNet(TINY).eval(), model, training={}, figures={})
        with pytest.raises(ModelError, match=r"tiny: cannot be written \(.*too large.*\); make room"), changed(model):
            pass
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (model / ONNX).read_bytes() == before
    assert [path.name for path in model.parent.iterdir()] == [model.name]


def test_where_a_new_model_cannot_take_its_place_the_old_one_stays(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = read_model_info(model)
    rename = os.replace

    def fails_into_place(source: Path, target: Path) -> None:
        if Path(target) == model and not Path(source).name.endswith(".old"):
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "replace", fails_into_place)
    torch.manual_seed(2)
    with pytest.raises(ModelError, match="No space"):
        save_model(DualUNet(TINY).eval(), model, training={}, figures={})
    monkeypatch.undo()
    assert read_model_info(model) == before
    assert [path.name for path in model.parent.iterdir()] == [model.name], "nothing is left lying about"


def test_a_new_model_is_on_the_disk_before_the_old_one_goes(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    sync, rename, remove = os.fsync, os.replace, shutil.rmtree

    def syncs(handle: int) -> None:
        done.append(f"on disk: {Path(os.readlink(f'/proc/self/fd/{handle}')).name}")
        sync(handle)

    def renames(source: Path, target: Path) -> None:
        done.append("moved" if Path(target) == model else "aside")
        rename(source, target)

    def removes(path: Path, **kwargs: bool) -> None:
        if Path(path).name.endswith(".old"):
            done.append("old one deleted")
        remove(path, **kwargs)

    monkeypatch.setattr(os, "fsync", syncs)
    monkeypatch.setattr(os, "replace", renames)
    monkeypatch.setattr(shutil, "rmtree", removes)
    save_model(DualUNet(TINY).eval(), model, training={}, figures={})
    assert {f"on disk: {name}" for name in (ONNX, INFO)} <= set(done[: done.index("aside")])
    assert done[done.index("moved") :] == ["moved", f"on disk: {model.parent.name}", "old one deleted"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"stride": 7}, "stride 7 is not 16 times the shape's fold 2"),
        ({"stride": 256}, "stride 256 is not 16 times"),
        ({"shape": TINY.to_json() | {"fold": "x"}}, "fold 'x'"),
        ({"shape": TINY.to_json() | {"inputs": "x"}}, "inputs are 3 or 5, not 'x'"),
        ({"shape": TINY.to_json() | {"inputs": None}}, "inputs are 3 or 5, not None"),
        ({"shape": TINY.to_json() | {"inputs": 5}}, "takes 5 planes, not 3"),
    ],
)
def test_a_manifest_that_contradicts_itself_is_one_clear_error(model: Path, change: dict[str, object], said: str) -> None:
    info = json.loads((model / INFO).read_text())
    (model / INFO).write_text(json.dumps(info | change))
    with pytest.raises(ModelError, match=said) as raised:
        open_segmenter(SegmentationConfig(model=str(model)))
    assert len(str(raised.value).splitlines()) == 1
