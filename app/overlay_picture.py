"""A picture with everything that was understood drawn in, as a person would put it on a slide. OpenCV only, no window needed."""

from __future__ import annotations

