"""What kind of pictures a model knows: signatures by hand, a fit that holds for new pictures, and the refusal of others."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from core.config.models import PerceptionConfig, TwinConfig
from core.devices import UserError
from core.evaluation.confidence import (
    LEAST,
    KnownPicture,
    OutOfDistributionError,
    find_known,
    fit_out_of_distribution,
    signatures_in,
)
from core.learning.dataset import DatasetError, write_png
from core.learning.model_writer import save_model, write_calibration
from core.perception.inference import OpenVinoSegmenter, TorchSegmenter
from core.perception.model_file import INFO, MODELS, ModelError, read_model_info
from core.perception.out_of_distribution import OutOfDistributionReference, signature_of
from core.perception.pipeline import CalibratedSegmenter, Pipeline, open_calibrated, open_pipeline
from core.perception.quality import ConfidenceCalibration, ConfidenceFeatures
from core.perception.segmentation import OrientationAverage, Segmentation, Segmenter
from core.perception.tip_refinement import TipRefinement
from core.perception.unet import DualUNet, UNetShape
from core.types import Frame, Image, Reason, Refusal
from hardware.twin.phantoms import PHANTOM_NAMES
from hardware.twin.world import TwinWorld

SHAPE = UNetShape((8, 8, 8, 8, 12), (8, 8, 8, 8), 1, 2)


def known(count: int, seed: int = 0) -> np.ndarray:
    """Signatures (count, 24) that differ most along three directions, and a bit along all."""
    rng = np.random.default_rng(seed)
    directions = np.random.default_rng(99).normal(size=(3, 24))
    return (2.0 + rng.normal(size=(count, 3)) @ directions + rng.normal(0, 0.2, (count, 24))).astype(np.float32)


def shown(count: int, groups: list[int] | None = None, folder: str = "set") -> list[KnownPicture]:
    """Pictures of a folder, each of a group of its own unless told otherwise."""
    return [KnownPicture(Path(f"{index}.png"), Path(folder), group) for index, group in enumerate(groups or range(count))]


def fitted(signatures: np.ndarray, groups: list[int] | None = None) -> OutOfDistributionReference:
    return fit_out_of_distribution(shown(len(signatures), groups), signatures, 640, {})


def test_a_signature_is_the_mean_over_all_and_over_the_vessel() -> None:
    deepest = np.zeros((3, 2, 4), np.float32)
    deepest[0, 0] = 4.0  # the upper half
    deepest[1, :, 0] = 8.0  # the left quarter
    vessel = np.zeros((64, 128), np.float32)
    vessel[:32] = 1.0
    signature = signature_of(deepest, vessel)
    np.testing.assert_allclose(np.expm1(signature), [2.0, 2.0, 0.0, 4.0, 2.0, 0.0], rtol=1e-3)
    nothing = signature_of(deepest, np.zeros_like(vessel))
    assert np.isfinite(nothing).all()
    assert nothing[3:].max() == 0.0, "no vessel, no half of a signature"


def test_new_pictures_of_the_known_kind_are_familiar_and_others_are_not() -> None:
    familiarity = fit_out_of_distribution(shown(400), known(400), 640, {"set": "drawn"})
    assert familiarity.fitted_on == {"set": "drawn", "pictures": 400}
    assert familiarity.distance(known(400)).mean() == pytest.approx(1.0, abs=0.1)
    fresh = familiarity.distance(known(2000, seed=1)) / familiarity.limit
    assert (fresh > 1.0).mean() < 0.02
    across = known(200, seed=2) + np.where(np.arange(24) == 5, 3.0, 0.0).astype(np.float32)
    assert (familiarity.distance(across) / familiarity.limit > 1.0).all(), "a direction in which known pictures never differ"
    farther = 2.0 + 4.0 * (known(200, seed=3) - 2.0)
    assert (familiarity.distance(farther) / familiarity.limit > 1.0).mean() > 0.9
    assert familiarity.novelty(across[0]) == pytest.approx(familiarity.distance(across)[0] / familiarity.limit)


def test_few_pictures_are_enough_for_a_limit_that_holds_for_new_ones() -> None:
    familiarity = fitted(known(LEAST))
    assert (familiarity.distance(known(500, seed=4)) / familiarity.limit > 1.0).mean() < 0.05


@pytest.mark.parametrize("told", [True, False])
def test_pictures_of_one_phantom_do_not_vouch_for_each_other(told: bool) -> None:
    """Thirty phantoms, sixteen nearly equal pictures of each: told of, the limit holds for other phantoms; else it would not."""
    phantoms, rng = known(30), np.random.default_rng(7)
    pictures = np.repeat(phantoms, 16, axis=0) + rng.normal(0, 0.02, (480, 24)).astype(np.float32)
    familiarity = fitted(pictures, [index // 16 for index in range(480)] if told else None)
    refused = (familiarity.distance(known(500, seed=8)) / familiarity.limit > 1.0).mean()
    assert refused < 0.1 if told else refused > 0.2


@pytest.mark.parametrize("groups", [[0] * 60, [0] * 59 + [1]])
def test_one_phantom_alone_is_halved(groups: list[int]) -> None:
    familiarity = fitted(known(60), groups)
    assert (familiarity.distance(known(500, seed=9)) / familiarity.limit > 1.0).mean() < 0.1


@pytest.mark.parametrize("count", [12, 80])
def test_another_folder_of_one_rig_does_not_open_the_door_to_everything(count: int) -> None:
    rig = np.zeros(24, np.float32)
    rig[5] = 6.0
    signatures = np.concatenate([known(400), known(count, seed=1) + rig])
    pictures = [*shown(400), *shown(count, [0] * count, "rig")]
    familiarity = fit_out_of_distribution(pictures, signatures, 640, {})
    assert (familiarity.distance(known(200, seed=2) + rig) / familiarity.limit > 1.0).mean() < 0.1, "it is known"
    rig[5], rig[7] = 0.0, 6.0
    assert (familiarity.distance(known(200, seed=2) + rig) / familiarity.limit > 1.0).mean() > 0.9, "others are not"


def test_known_pictures_are_grouped_by_their_seed_or_by_their_place(tmp_path: Path) -> None:
    (tmp_path / "set" / "images").mkdir(parents=True)
    (tmp_path / "plain").mkdir()
    for name in ("a", "b", "c"):
        write_png(tmp_path / "set" / "images" / f"{name}.png", np.zeros((8, 8, 3), np.uint8))
    for index in range(17):
        write_png(tmp_path / "plain" / f"{index:02}.png", np.zeros((8, 8, 3), np.uint8))
    rows = [{"stem": "a", "seed": 5}, {"stem": "b", "seed": 6}, {"stem": "c", "seed": 5}]
    (tmp_path / "set" / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    a, b, c = (picture.group for picture in find_known(tmp_path / "set"))
    assert a == c != b
    groups = [picture.group for picture in find_known(tmp_path / "plain")]
    assert {picture.folder for picture in find_known(tmp_path / "plain")} == {tmp_path / "plain"}
    assert len(set(groups[:16])) == 1 and groups[16] not in groups[:16]
    with pytest.raises(DatasetError, match=r"no pictures \(png, jpg"):
        find_known(tmp_path)


def test_only_pictures_whose_kind_would_be_asked_for_are_learnt_from(tmp_path: Path) -> None:
    black, white = np.zeros((480, 640, 3), np.uint8), np.full((480, 640, 3), 255, np.uint8)
    for name, image in (("0", IMAGE), ("1", black), ("2", white), ("4", IMAGE)):
        write_png(tmp_path / f"{name}.png", image)
    (tmp_path / "3.png").write_bytes(b"no picture")
    unreadable: list[UserError] = []
    found = list(signatures_in(find_known(tmp_path), Kind(known(1)[0]), PerceptionConfig(), unreadable.append))
    assert [one is not None for one in found] == [True, False, False, False, True]
    assert len(unreadable) == 1
    blind = list(signatures_in(find_known(tmp_path), Kind(known(1)[0], vessel=False), PerceptionConfig(), unreadable.append))
    assert blind == [None] * 5
    with pytest.raises(OutOfDistributionError, match="cannot tell kinds of pictures"):
        list(signatures_in(find_known(tmp_path), Blind(), PerceptionConfig(), unreadable.append))


def test_it_survives_json_and_damage_is_said() -> None:
    familiarity = fitted(known(100))
    again = OutOfDistributionReference.model_validate_json(familiarity.model_dump_json())
    assert again == familiarity
    np.testing.assert_array_equal(again.distance(known(9, 5)), familiarity.distance(known(9, 5)))
    values = familiarity.model_dump()
    for damage in (values["packed"][:-8], "!" + values["packed"][1:], "A" * len(values["packed"])):
        with pytest.raises(ValidationError, match="damaged; run calibrate again"):
            OutOfDistributionReference.model_validate(values | {"packed": damage})
    with pytest.raises(ValueError, match="gives 10 numbers, 24 are known"):
        familiarity.novelty(np.zeros(10, np.float32))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(7)
    network = DualUNet(SHAPE)
    torch.nn.init.constant_(network.vessel.output.bias, 3.0)  # nearly all is vessel
    with torch.no_grad():  # a normalisation that fits: else hardly anything reaches the deepest level
        for _ in range(100):
            network.train()(torch.from_numpy(np.stack(pictures(3)).transpose(0, 3, 1, 2)).float() / 255)
    folder = tmp_path_factory.mktemp("models") / "small"
    save_model(network.eval(), folder, training={}, figures={}, examples=pictures(3))
    return folder


def pictures(count: int) -> list[Image]:
    rng = np.random.default_rng(6)
    return [rng.integers(0, 256, (96, 128, 3)).astype(np.uint8) for _ in range(count)]


def test_every_engine_tells_the_same_signature(model: Path) -> None:
    exact, torch_s = OpenVinoSegmenter(model, 1, "fp32"), TorchSegmenter(model, 1)
    eight_bit = OpenVinoSegmenter(model, 1, "int8")
    for image, told in zip(pictures(3), exact.segment_signed(pictures(3)), strict=True):
        _, _, signature = told
        assert signature is not None and signature.shape == (24,)
        assert signature.max() > 0.01
        for engine in (torch_s, eight_bit):
            # Where the processor computes in bf16, OpenVINO does so in place of fp32.
            np.testing.assert_allclose(engine.segment_signed([image])[0][2], signature, atol=0.15 * float(signature.max()))
        for one, other in zip(exact(image), told[:2], strict=True):
            np.testing.assert_allclose(one, other, atol=0.02)


def test_whoever_looks_again_or_turned_tells_the_first_looks_signature(model: Path) -> None:
    segment = OpenVinoSegmenter(model, 1, "fp32")
    (image,) = pictures(1)
    wanted = segment.segment_signed([image])[0][2]
    for looking in (
        OrientationAverage(segment),
        TipRefinement(segment, Blind()),
        TipRefinement(OrientationAverage(segment), Blind()),
    ):
        vessel, robot, signature = looking.segment_signed([image])[0]
        np.testing.assert_allclose(signature, wanted, atol=0.01)
        for one, other in zip(looking(image), (vessel, robot), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-5)
    assert Blind().segment_signed([image])[0][2] is None


class Blind(Segmenter):
    """A segmenter that tells no signature."""

    engine = "a test's"

    def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(image.shape[:2], np.float32), np.zeros(image.shape[:2], np.float32)


class Kind(Blind):
    """Sees a vessel and a robot in it, and tells the signature it is given."""

    def __init__(self, signature: np.ndarray, robot: bool = True, vessel: bool = True) -> None:
        self.signature, self.robot, self.vessel = signature, robot, vessel

    def segment_signed(self, images: list[Image]) -> list[Segmentation]:
        vessel, robot = (np.zeros(images[0].shape[:2], np.float32) for _ in range(2))
        vessel[180:300, :] = 0.99 if self.vessel else 0.0
        robot[235:244, 0:300] = 0.99 if self.robot else 0.0
        return [(vessel, robot, self.signature) for _ in images]


IMAGE = np.random.default_rng(0).integers(0, 256, (480, 640, 3)).astype(np.uint8)
FAMILIARITY = fitted(known(200))
OTHER = known(1)[0] + np.float32(9.0)


def perceived(
    segment: Kind, config: PerceptionConfig | None = None, familiarity: OutOfDistributionReference | None = FAMILIARITY
) -> Reason | None:
    scene = Pipeline(CalibratedSegmenter(segment, known=familiarity), config or PerceptionConfig())(Frame(0, 0.0, IMAGE))
    assert (scene.novelty is None) == (familiarity is None or not segment.vessel)
    return None if scene.refusal is None else scene.refusal.reason


def test_a_picture_of_another_kind_is_refused_and_shown_as_it_was_seen() -> None:
    assert perceived(Kind(known(1)[0])) is None
    assert perceived(Kind(OTHER)) is Reason.UNLIKE_TRAINING
    assert perceived(Kind(OTHER), familiarity=None) is None, "nobody has told what is known"
    scene = Pipeline(CalibratedSegmenter(Kind(OTHER), known=FAMILIARITY), PerceptionConfig()).perceive_single(Frame(0, 0.0, IMAGE))
    assert scene.pose is None
    assert scene.path is not None and scene.vessel_vector is not None, "who labels it begins with what was seen"
    assert f"distance {scene.novelty:.2f} from the pictures that it knows (at most 1.25)" in str(scene.refusal)


def test_other_reasons_come_first_and_no_robot_tells_of_the_kind() -> None:
    def refusal(segment: Kind) -> Refusal | None:
        return Pipeline(CalibratedSegmenter(segment, known=FAMILIARITY), PerceptionConfig())(Frame(0, 0.0, IMAGE)).refusal

    assert str(refusal(Kind(known(1)[0], robot=False))) == "no robot: highest robot probability 0.00"
    assert "0.00; it does not know such pictures: distance" in str(refusal(Kind(OTHER, robot=False)))
    assert perceived(Kind(OTHER, robot=False)) is Reason.NO_ROBOT
    assert perceived(Kind(OTHER, vessel=False)) is Reason.NO_VESSEL


def test_in_a_stream_a_rig_at_the_limit_does_not_come_and_go() -> None:
    """It is refused above the limit, and known again only well below it, or after the stream began anew."""
    step = OTHER - known(1)[0]
    shares = np.linspace(0, 1, 400)
    novelty = np.array([FAMILIARITY.novelty(known(1)[0] + np.float32(share) * step) for share in shares])
    config = PerceptionConfig.model_validate({"tracking": {"window_px": 0}})
    limits = (share * config.quality.max_novelty for share in (1.01, 0.95, 0.8))
    at_limit, below, well_below = (float(shares[np.argmax(novelty > limit)]) for limit in limits)

    segment = Kind(OTHER)
    pipeline = Pipeline(CalibratedSegmenter(segment, known=FAMILIARITY), config)

    def refused(share: float, at_s: float) -> bool:
        segment.signature = known(1)[0] + np.float32(share) * step
        return pipeline(Frame(0, at_s, IMAGE)).refusal is not None

    seen = [refused(share, 0.05 * index) for index, share in enumerate([below, at_limit, below, well_below, below, at_limit])]
    assert seen == [False, True, True, False, False, True]
    pipeline.reset()
    assert not refused(below, 1.0)
    single = CalibratedSegmenter(segment, known=FAMILIARITY)
    alone = Pipeline(CalibratedSegmenter(segment, known=FAMILIARITY), config, single=single)
    for share, wanted in ((at_limit, True), (below, False)):
        segment.signature = known(1)[0] + np.float32(share) * step
        assert (alone.perceive_single(Frame(0, 0.0, IMAGE)).refusal is not None) == wanted, "single pictures know of no others"


def test_what_a_model_knows_is_kept_in_its_manifest_and_used(model: Path) -> None:
    segment = OpenVinoSegmenter(model, 1)
    seen = np.array([segment.segment_signed([image])[0][2] for image in pictures(LEAST)])
    names = ConfidenceFeatures.names()
    zeros = (0.0,) * len(names)
    calibration = ConfidenceCalibration(features=names, mean=zeros, scale=(1.0,) * len(names), weights=zeros, offset=0.0)
    write_calibration(model, calibration, familiarity=fitted(seen))
    config = PerceptionConfig.model_validate({"segmentation": {"model": str(model), "threads": 1}})
    assert [sight.known is not None for sight in open_calibrated(config)] == [True, True]
    assert [sight.known for sight in open_calibrated(config, recalibrating=True)] == [None, None], (
        "all of them are to be learnt from"
    )
    smaller = config.model_copy(update={"working_size_px": 320})
    pipeline = open_pipeline(config)
    asked = [(pipeline, True), (pipeline.with_config(config), True), (pipeline.with_config(smaller), False)]
    for one, told in (*asked, (open_pipeline(smaller), False), (open_pipeline(smaller).with_config(config), True)):
        for scene in (one(Frame(0, 0.0, pictures(1)[0])), one.perceive_single(Frame(0, 0.0, pictures(1)[0]))):
            # At another size than it was learnt at nobody can tell.
            assert scene.masks.vessel.any()
            assert (scene.novelty is not None) is told


def test_of_another_network_it_is_refused(model: Path, tmp_path: Path) -> None:
    save_model(DualUNet(replace(SHAPE, widths=(8, 8, 8, 8, 16))), tmp_path / "wider", training={}, figures={})
    info = read_model_info(tmp_path / "wider").model_copy(update={"familiarity": FAMILIARITY})
    (tmp_path / "wider" / INFO).write_text(info.model_dump_json())
    with pytest.raises(ModelError, match="familiarity is of another network; run calibrate again"):
        read_model_info(tmp_path / "wider")
    values = json.loads((tmp_path / "wider" / INFO).read_text())
    for widths in ([], [None], None):
        values["shape"]["widths"] = widths
        (tmp_path / "wider" / INFO).write_text(json.dumps(values))
        with pytest.raises(ModelError, match="familiarity is of another network"):
            read_model_info(tmp_path / "wider")


def test_the_shipped_model_knows_the_twin_on_every_engine() -> None:
    """Its own look and all named phantoms are well within; what an engine's rounding does is small against the limit."""
    world = [TwinWorld(TwinConfig(phantom=name, appearance_seed=place), seed=place) for place, name in enumerate(PHANTOM_NAMES)]
    for one in world:
        one.insert(60.0)
    images = [one.frame().image for one in world]
    familiarity = read_model_info(MODELS / "default").familiarity
    exact, eight_bit, torch_s = (
        OpenVinoSegmenter(MODELS / "default", 1, "fp32"),
        OpenVinoSegmenter(MODELS / "default", 1, "int8"),
        TorchSegmenter(MODELS / "default", 1),
    )
    for image in images:
        shipped, *others = (familiarity.novelty(engine.segment_signed([image])[0][2]) for engine in (eight_bit, exact, torch_s))
        assert shipped < 0.85
        assert others == pytest.approx([shipped] * 2, abs=0.08)
