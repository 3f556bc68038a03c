"""How true and steady perception is in a stream: errors, swaps of head and tail, the head's jumps, the lag and jitter of theta."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.study.accuracy import WRONG_DEG, WRONG_PX
from core.types import Point, Scene

JUMP_PX = 20.0
LAGS = np.arange(-4.0, 8.01, 0.25)
"""Lags that are tried, in frames."""
LAG_CAP_DEG = 10.0
"""Larger errors count like this one: a wrong branch says nothing about the lag."""
MIN_LAG_SAMPLES = 30
MIN_TURN_DEG = 0.1
"""Where the true theta changes by less than this per frame, no lag can be told."""


@dataclass(frozen=True, slots=True)
class StreamFrame:
    """One frame of a stream: what was found (None: no answer) and what is true (None: no pose). Points in source px."""

    head: Point | None
    tail: Point | None
    theta_signed_deg: float | None
    state: str | None
    true_head: Point | None
    true_tail: Point | None
    true_theta_signed_deg: float | None
    true_state: str | None

    @property
    def is_swapped(self) -> bool:
        """Whether the answer took the tail for the head."""
        if self.head is None or self.tail is None or self.true_head is None or self.true_tail is None:
            return False
        right = _gap(self.head, self.true_head) + _gap(self.tail, self.true_tail)
        return _gap(self.head, self.true_tail) + _gap(self.tail, self.true_head) < right


def stream_frame(scene: Scene, truth: dict[str, Any]) -> StreamFrame:
    """What `scene` answered beside a truth row as ``synth`` writes it."""
    pose, path = scene.pose, scene.path
    has_pose = truth.get("state") is not None
    answered = pose is not None and path is not None
    return StreamFrame(
        head=scene.to_source(path.head) if answered and path is not None else None,
        tail=scene.to_source(path.tail) if answered and path is not None else None,
        theta_signed_deg=pose.theta_signed_deg if pose is not None else None,
        state=pose.state.value if pose is not None else None,
        true_head=_pair(truth["head_xy"]) if has_pose else None,
        true_tail=_pair(truth["tail_xy"]) if has_pose else None,
        true_theta_signed_deg=float(truth["theta_signed_deg"]) if has_pose else None,
        true_state=truth["state"] if has_pose else None,
    )


def stream_figures(streams: Sequence[Sequence[StreamFrame]]) -> dict[str, float | int | None]:
    """The sums over several streams of consecutive frames.

    Returns
    -------
    ``frames`` with a true pose; ``answered_share``; ``state_agreement`` with the true state, which knows no hysteresis;
    ``theta_median_deg``, ``theta_mean_deg``, ``head_median_px`` of the absolute errors; ``wrong_share`` of the answers, by more
    than 10 degrees or 15 px; ``swapped_frames``, answers that took the tail for the head; ``jumps``, answers whose head moved by
    more than ``JUMP_PX`` other than the true head did since the answer before; ``theta_lag_frames``, the delay of the true theta
    that fits the found one best (None: it moved too little to tell); ``theta_jitter_deg`` and ``head_jitter_px``, the robust
    standard deviation of the error's change from frame to frame; ``state_changes`` and ``true_state_changes``.
    """
    frames = [frame for stream in streams for frame in stream if frame.true_state is not None]
    answered = [frame for frame in frames if frame.state is not None]
    head_moves = [move for stream in streams for move in _head_moves(stream)]
    theta_moves = [_turn(b, a) for stream in streams for a, b in _pairs(_theta_errors(stream))]
    steady = [move for move in head_moves if move <= JUMP_PX]
    errors = np.array([error for stream in streams for error in _errors(stream)], np.float64).reshape(-1, 2)
    theta, head = errors.T
    is_wrong = (theta > WRONG_DEG) | (head > WRONG_PX)
    return {
        "frames": len(frames),
        "answered_share": len(answered) / len(frames) if frames else None,
        "state_agreement": sum(f.state == f.true_state for f in answered) / len(answered) if answered else None,
        "theta_median_deg": float(np.median(theta)) if len(theta) else None,
        "theta_mean_deg": float(theta.mean()) if len(theta) else None,
        "head_median_px": float(np.median(head)) if len(head) else None,
        "wrong_share": float(is_wrong.mean()) if len(theta) else None,
        "swapped_frames": sum(frame.is_swapped for frame in answered),
        "jumps": len(head_moves) - len(steady),
        "theta_lag_frames": _lag(streams),
        "theta_jitter_deg": _spread(theta_moves, 1.4826),
        "head_jitter_px": _spread(steady, 1.0 / 1.1774),
        "state_changes": sum(_changes([f.state for f in stream]) for stream in streams),
        "true_state_changes": sum(_changes([f.true_state for f in stream]) for stream in streams),
    }


def _pair(values: Sequence[float]) -> Point:
    return float(values[0]), float(values[1])


def _gap(a: Point, b: Point) -> float:
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))


def _turn(to: float, since: float) -> float:
    return (to - since + 180.0) % 360.0 - 180.0


def _spread(changes: Sequence[float], scale: float) -> float | None:
    """Standard deviation from the median size of changes: `scale` is 1.4826 for a number, 1/1.1774 for the length of a 2-D step."""
    return scale * float(np.median(np.abs(changes))) if changes else None


def _errors(stream: Sequence[StreamFrame]) -> list[tuple[float, float]]:
    """By how much theta (degrees) and the head (px) of each answer are off."""
    thetas = _theta_errors(stream)
    return [
        (abs(theta), _gap(frame.head, frame.true_head))
        for theta, frame in zip(thetas, stream, strict=True)
        if theta is not None and frame.head is not None and frame.true_head is not None
    ]


def _head_moves(stream: Sequence[StreamFrame]) -> list[float]:
    """How much the head's error changed between each answer and the one before it, in px."""
    errors = [
        (frame.head[0] - frame.true_head[0], frame.head[1] - frame.true_head[1])
        for frame in stream
        if frame.head is not None and frame.true_head is not None
    ]
    return [_gap(a, b) for a, b in zip(errors, errors[1:], strict=False)]


def _theta_errors(stream: Sequence[StreamFrame]) -> list[float | None]:
    return [
        None
        if frame.theta_signed_deg is None or frame.true_theta_signed_deg is None
        else _turn(frame.theta_signed_deg, frame.true_theta_signed_deg)
        for frame in stream
    ]


def _pairs(values: Sequence[float | None]) -> list[tuple[float, float]]:
    """Values of frames that follow each other."""
    return [(a, b) for a, b in zip(values, values[1:], strict=False) if a is not None and b is not None]


def _changes(states: Sequence[str | None]) -> int:
    shown = [state for state in states if state is not None]
    return sum(a != b for a, b in zip(shown, shown[1:], strict=False))


def _lag(streams: Sequence[Sequence[StreamFrame]]) -> float | None:
    costs, moves = [], []
    for stream in streams:
        true = np.array([np.nan if f.true_theta_signed_deg is None else f.true_theta_signed_deg for f in stream], np.float64)
        found = np.array([np.nan if f.theta_signed_deg is None else f.theta_signed_deg for f in stream], np.float64)
        costs.append(_lag_costs(true, found))
        moves += [abs(_turn(b, a)) for a, b in zip(true, true[1:], strict=False) if np.isfinite(a + b)]
    cost = np.concatenate(costs) if costs else np.empty((0, len(LAGS)))
    if len(cost) < MIN_LAG_SAMPLES or float(np.mean(moves)) < MIN_TURN_DEG:
        return None
    mean = cost.mean(axis=0)
    best = int(np.argmin(mean))
    if best in (0, len(LAGS) - 1):
        return float(LAGS[best])
    before, here, after = mean[best - 1 : best + 2].tolist()
    curvature = before - 2.0 * here + after
    shift = 0.5 * (before - after) / curvature if curvature > 0.0 else 0.0
    return float(LAGS[best] + shift * (LAGS[1] - LAGS[0]))


def _lag_costs(true: NDArray[np.float64], found: NDArray[np.float64]) -> NDArray[np.float64]:
    """Capped squared difference between the found theta and the true one of `LAGS` frames ago, shape (frames, lags)."""
    first, last = int(np.ceil(LAGS[-1])), len(true) - 1 - int(np.ceil(-LAGS[0]))
    rows = []
    for frame in range(first, last + 1):
        places = frame - LAGS
        low = np.floor(places).astype(int)
        high = np.minimum(low + 1, len(true) - 1)
        turn = (true[high] - true[low] + 180.0) % 360.0 - 180.0
        then = true[low] + (places - low) * turn
        error = np.abs((found[frame] - then + 180.0) % 360.0 - 180.0)
        if np.isfinite(error).all():
            rows.append(np.minimum(error, LAG_CAP_DEG) ** 2)
    return np.array(rows, np.float64).reshape(-1, len(LAGS))
