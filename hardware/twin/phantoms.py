"""The named phantoms. Each has a character of its own; coordinates are board millimetres (x right, y down)."""

from __future__ import annotations

from collections.abc import Callable

from hardware.twin.channels import Sketch
from hardware.twin.phantom import PHANTOM_TITLES, Phantom
from hardware.twin.random_phantom import random_phantom


def _s_curve() -> Sketch:
    sketch = Sketch()
    sketch.run(
        [(-1, 34), (24, 33), (66, 28), (98, 52), (104, 88), (130, 119), (166, 112), (178, 84), (170, 60)],
        [6.0, 6.0, 5.2, 4.6, 5.6, 6.2, 5.0, 4.2, 4.0],
    )
    return sketch


def _y_branch() -> Sketch:
    sketch = Sketch()
    stem = sketch.run([(96, 151), (97, 128), (102, 100), (92, 72), (66, 44), (48, 16)], [7.0, 7.0, 6.6, 6.0, 4.8, 4.2])
    sketch.branch(stem, (101, 95), 40.0, [(120, 70), (141, 44), (166, 30)], [6.0, 5.0, 4.6, 3.8])
    return sketch


def _tree() -> Sketch:
    # A narrow trunk: in a wide one the bent tip finds no wall to lean on, the shaft goes straight on and misses the branches.
    sketch = Sketch()
    trunk = sketch.run(
        [(-1, 78), (22, 78), (56, 76), (92, 80), (124, 69), (154, 72), (186, 64)], [5.0, 4.8, 4.6, 4.6, 4.4, 4.2, 3.8]
    )
    upper = sketch.branch(trunk, (42, 77), -36.0, [(66, 54), (86, 32), (116, 18)], [5.0, 4.8, 4.4, 3.9])
    sketch.branch(upper, (74, 45), 42.0, [(98, 44), (128, 42), (158, 32)], [4.6, 4.2, 4.0, 3.7])
    lower = sketch.branch(trunk, (84, 80), 34.0, [(106, 96), (121, 117), (134, 138)], [4.8, 4.4, 4.2, 3.7])
    sketch.branch(lower, (108, 98), -36.0, [(128, 106), (154, 106), (180, 98)], [4.6, 4.2, 4.0, 3.8])
    return sketch


def _aortic_arch() -> Sketch:
    sketch = Sketch()
    aorta = sketch.run(
        [(146, 151), (146, 128), (144, 104), (134, 76), (108, 60), (80, 68), (64, 92), (60, 122)],
        [9.0, 9.0, 9.4, 10.0, 10.4, 10.6, 11.0, 11.6],
    )
    sketch.branch(aorta, (133, 75), 50.0, [(140, 44), (152, 26), (156, 9)], [4.6, 4.4, 4.2, 4.0])
    sketch.branch(aorta, (110, 60), 62.0, [(106, 34), (112, 10)], [4.4, 4.2, 3.9])
    innominate = sketch.branch(aorta, (86, 64), 62.0, [(68, 42), (66, 24), (70, 9)], [5.6, 5.2, 4.4, 4.0])
    sketch.branch(innominate, (70, 44), -48.0, [(44, 33), (18, 29)], [4.4, 4.2, 3.8])
    return sketch


def _tortuous() -> Sketch:
    sketch = Sketch()
    sketch.run(
        [(-1, 104), (22, 103), (42, 88), (52, 64), (70, 50), (88, 63), (94, 90), (110, 105), (126, 92), (130, 64), (145, 48),
         (161, 62), (166, 88), (182, 100)],
        [5.4, 5.4, 5.0, 4.4, 5.0, 4.6, 4.0, 4.8, 4.4, 3.8, 4.8, 4.4, 4.0, 3.8],
    )  # fmt: skip
    return sketch


def _cerebral_siphon() -> Sketch:
    sketch = Sketch()
    carotid = sketch.run(
        [(58, 151), (58, 128), (64, 102), (86, 92), (106, 98), (123, 90), (120, 72), (104, 62), (106, 46), (124, 40), (152, 44),
         (184, 36)],
        [5.0, 5.0, 4.8, 4.6, 4.5, 4.4, 4.4, 4.6, 5.0, 4.6, 4.0, 3.6],
    )  # fmt: skip
    sketch.branch(carotid, (112, 42), -52.0, [(116, 22), (98, 12), (72, 20), (52, 14)], [3.9, 3.8, 3.7, 3.6, 3.5])
    sketch.branch(carotid, (149, 43), 40.0, [(166, 61), (184, 72)], [4.0, 3.8, 3.6])
    return sketch


def _parallel_channels() -> Sketch:
    sketch = Sketch()
    middle = sketch.run([(-1, 75), (22, 75), (60, 75), (120, 77), (170, 73), (201, 75)], [7.0, 7.0, 5.0, 4.4, 4.8, 5.0])
    sketch.branch(middle, (26, 75), -40.0, [(46, 54), (78, 45), (128, 47), (172, 44), (201, 45)], [5.4, 5.2, 5.0, 4.2, 4.6, 4.8])
    sketch.branch(middle, (40, 75), 42.0, [(60, 94), (86, 104), (132, 103), (172, 106), (201, 105)], [5.2, 5.0, 4.8, 4.2, 4.6, 4.8])
    return sketch


def _loop() -> Sketch:
    sketch = Sketch()
    upper = sketch.run(
        [(201, 84), (178, 84), (150, 74), (124, 46), (92, 38), (62, 52), (38, 72), (12, 76)],
        [6.4, 6.4, 5.8, 4.8, 4.6, 5.0, 5.4, 4.2],
    )
    sketch.branch(
        upper, (156, 77), -44.0, [(122, 106), (90, 117), (60, 102)], [5.2, 5.0, 4.4, 4.6, 5.0], rejoin=(upper, (36, 73), 50.0)
    )
    return sketch


def _coronary() -> Sketch:
    sketch = Sketch()
    main = sketch.run(
        [(30, -1), (32, 20), (46, 44), (76, 56), (110, 58), (142, 74), (162, 102), (168, 134)],
        [5.6, 5.6, 5.2, 4.8, 3.6, 4.6, 4.0, 3.5],
    )
    sketch.branch(main, (40, 36), 50.0, [(38, 68), (42, 98), (62, 124), (92, 136)], [4.6, 4.6, 5.8, 4.2, 3.6])
    sketch.branch(main, (84, 57), 50.0, [(100, 82), (122, 106), (128, 130)], [4.2, 4.0, 3.8, 3.5])
    sketch.branch(main, (106, 57), -44.0, [(130, 40), (156, 36), (184, 26)], [4.2, 4.0, 3.8, 3.5])
    return sketch


_DRAWN: dict[str, Callable[[], Sketch]] = {
    "s_curve": _s_curve,
    "y_branch": _y_branch,
    "tree": _tree,
    "aortic_arch": _aortic_arch,
    "tortuous": _tortuous,
    "cerebral_siphon": _cerebral_siphon,
    "parallel_channels": _parallel_channels,
    "loop": _loop,
    "coronary": _coronary,
}

PHANTOM_NAMES: tuple[str, ...] = tuple(PHANTOM_TITLES)


def make_phantom(name: str) -> Phantom:
    """The phantom called `name`: one of ``PHANTOM_NAMES`` or ``random:<seed>``.

    Raises
    ------
    ValueError
        When there is no such phantom; the message lists the names.
    """
    kind, _, seed = name.partition(":")
    if kind == "random" and seed.isdecimal():
        return random_phantom(int(seed))
    if name not in _DRAWN:
        raise ValueError(f"unknown phantom {name!r}; known: {', '.join(PHANTOM_NAMES)}, random:<seed>")
    return Phantom(name, PHANTOM_TITLES[name], _DRAWN[name]().graph(), port=0)
