"""Out-of-distribution detection: whether a picture is of a kind that the model knows.

A network also answers about pictures of a kind that it never saw, and its probabilities do not show it. Its deepest level does:
known rigs, lights and devices give similar values there, others do not. After K. Lee et al., "A simple unified framework for
detecting out-of-distribution samples and adversarial attacks", NeurIPS 2018; here with the few directions in which known pictures
differ most, and all others taken together, so that some hundred pictures are enough.
"""

from __future__ import annotations

import base64
import functools
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

Signature = NDArray[np.float32]
"""Shape (2 C,): means of the deepest level's C channels over a picture, and over its vessel."""

_FLOOR = 1e-3
"""Added to the vessel's sum over the deepest level's cells: without a vessel the second half is nearly 0."""


def signature_of(deepest: NDArray[np.float32], vessel: NDArray[np.float32]) -> Signature:
    """The signature of a picture: of what the encoder's last level gives, (C, h, w), not negative.

    `vessel` is its probability (H, W), with H and W the same multiple of h and w.
    """
    height, width = deepest.shape[1:]
    weight = cv2.resize(vessel, (width, height), interpolation=cv2.INTER_AREA)
    weighted = deepest.reshape(len(deepest), -1) @ weight.reshape(-1) / (weight.sum() + _FLOOR)
    # Channels are skewed: 0 in most pictures, large in some.
    return np.asarray(np.log1p(np.concatenate([deepest.mean(axis=(1, 2)), weighted])), np.float32)


class OutOfDistributionReference(BaseModel):
    """Where the signatures of known pictures lie: around a mean, spread along ``axes`` directions and less across them.

    ``limit`` is the distance that hardly any known picture exceeds, ``working_size_px`` the longer side at which they were seen.
    ``packed`` holds float32 numbers, little-endian, as base64: mean (size), scale (size), directions (axes, size), spread along
    each (axes), mean square across all of them (1), the latter two of signatures that were divided by the scale.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    size: int = Field(ge=2, le=100_000)
    axes: int = Field(ge=1, le=1000)
    limit: float = Field(gt=0.0)
    working_size_px: int = Field(ge=1)
    packed: str
    fitted_on: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        try:
            numbers = _unpacked(self.packed)
        except ValueError:
            raise ValueError(_DAMAGED) from None
        wanted = (2 + self.axes) * self.size + self.axes + 1
        positive = np.concatenate([numbers[self.size : 2 * self.size], numbers[-self.axes - 1 :]])
        if len(numbers) != wanted or not np.isfinite(numbers).all() or positive.min() <= 0.0:
            raise ValueError(_DAMAGED)
        return self

    def distance(self, signatures: NDArray[np.float32]) -> NDArray[np.float64]:
        """How far signatures (N, size) lie from the known ones, whose mean square distance is 1; (N,)."""
        size, axes, numbers = self.size, self.axes, _unpacked(self.packed)
        mean, scale = numbers[:size], numbers[size : 2 * size]
        directions = numbers[2 * size : (2 + axes) * size].reshape(axes, size)
        spread, across = numbers[-axes - 1 : -1], float(numbers[-1])
        standard = (signatures - mean) / scale
        along = standard @ directions.T
        rest = np.maximum((standard**2).sum(axis=1) - (along**2).sum(axis=1), 0.0)
        return np.asarray(np.sqrt(0.5 * (((along / spread) ** 2).mean(axis=1) + rest / across)), np.float64)

    def novelty(self, signature: Signature) -> float:
        """How far a picture is from known ones, 1 at the ``limit``. Raises ValueError for another network's signature."""
        if signature.shape != (self.size,):
            raise ValueError(f"the network gives {signature.shape[0]} numbers, {self.size} are known; run calibrate again")
        return float(self.distance(signature[None])[0]) / self.limit


_DAMAGED = "what the model knows of kinds of pictures is damaged; run calibrate again"


def packed(*parts: NDArray[np.floating[Any]]) -> str:
    """Numbers in the format of ``OutOfDistributionReference.packed``."""
    return base64.b64encode(np.concatenate([np.ravel(part) for part in parts]).astype("<f4").tobytes()).decode("ascii")


@functools.lru_cache(maxsize=8)
def _unpacked(numbers: str) -> NDArray[np.float32]:
    return np.frombuffer(base64.b64decode(numbers, validate=True), "<f4")
