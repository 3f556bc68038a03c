"""Teaching from the operator window: the menu, the offer for pictures that are not known, and a taught model in use."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.operator.services import _UNFAMILIAR_S, WindowServices, is_teachable
from app.operator.window import OperatorWindow
from core.config.models import Config, load_config
from core.config.rig_file import make_rig, read_rig, with_rig, write_rig
from core.perception.model_file import own_models
from core.types import Reason, Refusal
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeEngine, until

UNKNOWN = Refusal(Reason.UNLIKE_TRAINING, "distance 1.40 from the pictures that it knows (at most 1.00)")


@pytest.fixture
def side(running: OperatorWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[WindowServices]:
    monkeypatch.setattr("app.teaching.model.teaching_folder", lambda rig: tmp_path / "teaching" / rig)
    side = WindowServices(running, tmp_path / "state")
    yield side
    side.close()


def refuse(window: OperatorWindow, refusal: Refusal | None) -> None:
    """The picture on the screen has this refusal."""
    tick = window.shown_tick
    window.shown_tick = replace(tick, scene=replace(tick.scene, refusal=refusal))


def look(side: WindowServices, window: OperatorWindow, refusal: Refusal | None, seconds: int = _UNFAMILIAR_S) -> None:
    for _ in range(seconds):
        refuse(window, refusal)
        side._look_for_unfamiliar()


def test_teaching_is_offered_once_where_pictures_are_not_known(side: WindowServices, running: OperatorWindow) -> None:
    refusal = UNKNOWN
    look(side, running, refusal, _UNFAMILIAR_S - 1)
    assert not running.panels.offers.text
    look(side, running, refusal, 1)
    assert running.panels.offers.text.startswith("The model does not know such pictures")
    running.panels.offers.answers["Not now"].click()
    look(side, running, refusal, 3 * _UNFAMILIAR_S)
    assert not running.panels.offers.text


def test_it_is_not_offered_for_other_refusals_or_moments(side: WindowServices, running: OperatorWindow) -> None:
    look(side, running, Refusal(Reason.BLURRED), 20)
    for _ in range(10):
        look(side, running, UNKNOWN, _UNFAMILIAR_S - 1)
        look(side, running, None, 1)
    assert not running.panels.offers.text


def test_the_hint_beside_a_robot_that_is_not_found_counts() -> None:
    assert all(is_teachable(one) for one in (UNKNOWN, Refusal(Reason.OTHER_BENCH), Refusal(Reason.BENCH_MOVED)))
    assert is_teachable(Refusal(Reason.NO_ROBOT, "highest robot probability 0.01; it does not know such pictures: distance 2.0"))
    assert not is_teachable(Refusal(Reason.NO_ROBOT, "highest robot probability 0.01"))


def test_the_menu_opens_the_window_and_opens_it_again_as_it_was(side: WindowServices, running: OperatorWindow) -> None:
    texts = [action.text().replace("&", "") for action in side.models._menu.actions()]
    assert texts[-2:] == ["Teach this bench...", "Train on my annotations..."]
    side.teach()
    window = side.teaching
    assert window.isVisible()
    window.close()
    side.teach()
    assert side.teaching is window


def test_a_taught_model_is_used_with_its_bench_and_the_one_before_can_be_chosen(
    side: WindowServices, running: OperatorWindow, qtbot: QtBot
) -> None:
    assert side._use_taught("mine_1") == ""
    perception = running.rig.config.perception
    assert perception.segmentation.model == "mine_1"
    assert perception.bench == str(own_models() / "mine_1" / "bench")
    until(qtbot, lambda: running.shown_tick is not None)
    side._use_model("default")
    assert running.rig.config.perception.segmentation.model == "default"


def test_while_another_phantom_is_shown_nothing_is_taken_of_it_and_the_bench_is_not_used(
    side: WindowServices, running: OperatorWindow, qtbot: QtBot
) -> None:
    side._use_taught("mine_1")
    side.teach()
    until(qtbot, lambda: side.teaching._newest() is not None)
    config = running.rig.config
    running.rig.use_config(config.model_copy(update={"twin": config.twin.model_copy(update={"phantom": "y_branch"})}))
    perception = running.rig.config.perception
    assert (perception.bench, perception.segmentation.model) == (None, "mine_1"), "it is opened without the bench"
    until(qtbot, lambda: running.shown_tick is not None)
    assert side.teaching._newest() is None
    assert "another bench is in use" in side._use_taught("mine_1")
    assert running.rig.config.perception.bench is None


def test_with_a_rig_file_model_and_bench_are_kept_in_it(
    make_window: MakeWindow, engine: FakeEngine, tmp_path: Path, qtbot: QtBot
) -> None:
    path = write_rig(make_rig(load_config(), "bench 2", None), tmp_path / "bench 2.toml")
    config = with_rig(Config.model_validate({"record": {"ring_s": 0}}), read_rig(path), path)
    window = make_window(lambda _config: engine, config)
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    side = WindowServices(window, tmp_path / "state")
    assert side._use_taught("mine_1") == ""
    rig = read_rig(path)
    assert rig.model == "mine_1"
    assert rig.bench == str(own_models() / "mine_1" / "bench")
    assert with_rig(Config(), rig, path).perception.segmentation.model == "mine_1"
    side.close()
