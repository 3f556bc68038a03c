"""Renews requirements.lock from pyproject.toml: ``python -m tools.lock [PACKAGE ...]`` (uv must be in the PATH).

The named packages get their newest permitted version, all others keep theirs. Each pin has the SHA-256 of all its files, for Python
3.11 to 3.13, so that pip takes no others. torch alone has none: pip takes the CPU build where it is offered, else the CUDA build
with packages that torch itself pins; both stay out of the file, and set-up installs torch by itself.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / "requirements.lock"
EXTRAS = ("cluster", "figures", "foxglove", "gym", "l515", "lerobot", "lsl", "ros2", "train")
"""Extras that set-up installs."""
FOR_NEWER_PYTHON = "pyrealsense2>=2.55 ; python_version >= '3.12'"
"""In the place of the extra l515, which has no build for it."""
TORCH = ("torch", "triton")
"""With these, packages whose names begin so are left out."""
_CUDA = ("nvidia-", "cuda-")
_TO_RUN, _TORCH, _TO_TEST = "# --- to run", "# --- to run: set-up installs it by itself, and without a hash", "# --- to test"
_PIN = re.compile(r"^([\w.-]+)==([^\s;\\]+)(.*(?:\n    .*)*)", re.MULTILINE)


def pins_of(text: str) -> dict[str, str]:
    """The lines of each package and marker, as they stand in a lock; without those that torch brings."""
    found = {}
    for match in _PIN.finditer(text):
        if match[1] not in TORCH and not match[1].startswith(_CUDA):
            marker = match[3].partition("\\")[0].strip()
            found[f"{match[1]} {marker}"] = match[0]
    return found


def compiled(kept: str, *, with_tests: bool) -> str:
    """What uv makes of pyproject.toml and the pins that are kept."""
    with tempfile.TemporaryDirectory() as folder:
        more, constraints = Path(folder) / "more.in", Path(folder) / "kept.txt"
        more.write_text(FOR_NEWER_PYTHON + "\n", encoding="utf-8")
        constraints.write_text(kept, encoding="utf-8")
        command = ["uv", "pip", "compile", "--quiet", "pyproject.toml", str(more), "--universal", "--python-version", "3.11"]
        command += ["--only-binary", ":all:", "--generate-hashes", "--no-annotate", "--no-header", "--constraint", str(constraints)]
        command += [word for extra in EXTRAS for word in ("--extra", extra)]
        command += ["--group", "test"] if with_tests else []
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def main() -> None:
    text = LOCK.read_text(encoding="utf-8")
    renewed = {name.lower() for name in sys.argv[1:]}
    old = [(match[1], match[2], match[3].partition("\\")[0].rstrip()) for match in _PIN.finditer(text)]
    kept = "\n".join(f"{name}=={version}{marker}" for name, version, marker in old if name.lower() not in renewed)
    everything = compiled(kept, with_tests=True)
    to_run = pins_of(compiled(kept, with_tests=False))
    to_test = {name: lines for name, lines in pins_of(everything).items() if name not in to_run}
    (torch,) = re.findall(r"^torch==[^\s;\\]+", everything, re.MULTILINE)
    parts = [
        text.partition(_TO_RUN)[0].rstrip(),
        "",
        _TO_RUN,
        *to_run.values(),
        "",
        _TORCH,
        torch,
        "",
        _TO_TEST,
        *to_test.values(),
        "",
    ]
    LOCK.write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
