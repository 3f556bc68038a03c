"""Make the three alert sounds of ``resources/sounds``: python tools/make_sounds.py [FOLDER].

They are told apart by melody and rhythm, not by loudness: "hold" rises once, "disarm" falls in three steps, "stop" is a fast run of
equal beeps. As IEC 60601-1-8 asks of alarms, the fundamental lies between 150 Hz and 1 kHz and has at least four harmonics, so
that a humming machine cannot mask all of it. Every pulse has soft edges and does not click.
"""

from __future__ import annotations

import sys
import wave
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

RATE_HZ = 22_050
PEAK = 0.7
_HARMONICS = (1.0, 0.55, 0.40, 0.28, 0.18)
_RISE_S, _FALL_S = 0.012, 0.035

# (frequency Hz, length s, pause after it s)
SOUNDS: dict[str, tuple[tuple[float, float, float], ...]] = {
    "hold": ((523.25, 0.13, 0.03), (783.99, 0.20, 0.0)),
    "disarm": ((783.99, 0.18, 0.04), (622.25, 0.18, 0.04), (392.00, 0.32, 0.0)),
    "stop": ((932.33, 0.085, 0.035),) * 6,
}


def pulse(frequency_hz: float, length_s: float) -> NDArray[np.float64]:
    """One tone with harmonics, amplitude at most 1, with cosine edges."""
    time_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
    tone = np.zeros_like(time_s)
    for k, share in enumerate(_HARMONICS, start=1):
        tone += share * np.sin(2.0 * np.pi * k * frequency_hz * time_s)
    rise = np.clip(time_s / _RISE_S, 0.0, 1.0)
    fall = np.clip((length_s - time_s) / _FALL_S, 0.0, 1.0)
    shaped: NDArray[np.float64] = tone / np.abs(tone).max() * (0.5 - 0.5 * np.cos(np.pi * np.minimum(rise, fall)))
    return shaped


def sound(notes: tuple[tuple[float, float, float], ...]) -> NDArray[np.int16]:
    """All notes after each other as 16-bit samples."""
    parts = []
    for frequency_hz, length_s, pause_s in notes:
        parts += [pulse(frequency_hz, length_s), np.zeros(round(pause_s * RATE_HZ))]
    return np.round(np.concatenate(parts) * PEAK * 32767.0).astype("<i2")


def write(path: Path, samples: NDArray[np.int16]) -> None:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(samples.tobytes())


def main() -> None:
    home = Path(__file__).resolve().parent.parent / "resources" / "sounds"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else home
    folder.mkdir(parents=True, exist_ok=True)
    for name, notes in SOUNDS.items():
        write(folder / f"{name}.wav", sound(notes))


if __name__ == "__main__":
    main()
