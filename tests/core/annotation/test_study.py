"""Queues and studies: who sees what in which order."""

import pytest

from core.annotation.model import AnnotationError, ImageView
from core.annotation.study import QueueOrder, StudySettings, queue_order, repeat_views, settings_from, tasks

IMAGES = tuple(f"image {number}" for number in range(20))


def test_each_rater_sees_each_image_once_in_each_pass_in_another_order() -> None:
    settings = StudySettings(IMAGES, repeat_views(3, mirror=True, turn=True), seed=4)
    ann, bob = tasks(settings, "ann"), tasks(settings, "bob")
    for repeat, view in ((1, ImageView.AS_IS), (2, ImageView.MIRRORED), (3, ImageView.TURNED)):
        one_pass = ann[20 * (repeat - 1) : 20 * repeat]
        assert {task.sha256 for task in one_pass} == set(IMAGES)
        assert {(task.repeat, task.view) for task in one_pass} == {(repeat, view)}
    orders = [[task.sha256 for task in part] for part in (ann[:20], ann[20:40], bob[:20])]
    assert orders[0] != orders[1]
    assert orders[0] != orders[2]
    assert list(IMAGES) not in orders
    assert tasks(settings, "ann") == ann, "the same every time the window opens"


@pytest.mark.parametrize("count", [1, 2, 3, 12, 47])
def test_half_of_the_images_lie_between_two_showings_of_one(count: int) -> None:
    order = [task.sha256 for task in tasks(StudySettings(tuple(map(str, range(count))), (ImageView.AS_IS,) * 3), "ann")]
    for image in set(order):
        places = [place for place, shown in enumerate(order) if shown == image]
        assert min(b - a for a, b in zip(places, places[1:], strict=False)) - 1 >= count // 2 - (count % 2)


def test_repeats_in_turn() -> None:
    assert repeat_views(2, mirror=False, turn=False) == (ImageView.AS_IS, ImageView.AS_IS)
    assert repeat_views(2, mirror=False, turn=True) == (ImageView.AS_IS, ImageView.TURNED)
    assert repeat_views(4, mirror=True, turn=True) == (ImageView.AS_IS, ImageView.MIRRORED, ImageView.TURNED, ImageView.MIRRORED)
    assert repeat_views(1, mirror=True, turn=False) == (ImageView.AS_IS,)


def test_worst_first_and_refused_before_all() -> None:
    assert queue_order(["a", "b", "c"], QueueOrder.WORST, {"a": 0.9, "b": 0.4}) == ("c", "b", "a")


def test_even_goes_ever_finer() -> None:
    assert queue_order("abcdefgh", QueueOrder.EVEN) == tuple("aecgbfdh")
    for count in (1, 2, 5, 48):
        assert sorted(queue_order([str(k) for k in range(count)], QueueOrder.EVEN)) == sorted(str(k) for k in range(count))


def test_settings_come_back_and_damage_is_named() -> None:
    settings = StudySettings(IMAGES, (ImageView.AS_IS, ImageView.TURNED), QueueOrder.EVEN, 9)
    assert settings_from(settings.to_json(), "here") == settings
    for damaged in ({}, settings.to_json() | {"views": ["upside down"]}, settings.to_json() | {"images": []}):
        with pytest.raises(AnnotationError, match="here: the settings of the study are damaged"):
            settings_from(damaged, "here")
