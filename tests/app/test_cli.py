"""The command line's table of contents: what there is, in which order it is listed, and that to ask costs nothing."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import app, main
from app.commands import synth
from app.commands.options import bare_stream, with_outputs
from core.config.models import Config
from hardware.twin.catalog import BENCH_LOOK, OWN_LOOK
from hardware.twin.dataset import PAINTED_LOOK
from hardware.twin.rendering.presets import RARE_FAMILIES

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = (
    "gui", "perceive", "synth", "train", "teach", "calibrate", "annotate", "evaluate", "phantom", "rehearse", "trial", "benchmark",
    "record", "replay", "trigger", "play", "library", "doctor", "desktop", "session", "rig",
)  # fmt: skip
INNER = {
    "session": ("info", "describe", "recover", "export"),
    "rig": ("list", "show", "calibrate", "accept", "identify", "restore-servos", "board"),
}
SLOW = ("PySide6", "numpy", "torch", "openvino", "cv2", "scipy", "mujoco", "pydantic", "rich")


def help_of(*path: str) -> str:
    result = CliRunner().invoke(app, [*path, "--help"], prog_name="main.py")
    assert result.exit_code == 0
    return result.output


def listed(text: str) -> tuple[str, ...]:
    """Names of a help page's list of commands."""
    _, _, commands = text.partition("Commands:\n")
    return tuple(line.split()[0] for line in commands.splitlines() if line.strip())


def test_commands_are_listed_in_their_order_and_groups_after_them() -> None:
    assert listed(help_of()) == COMMANDS
    for group, names in INNER.items():
        assert listed(help_of(group)) == names


def test_every_command_says_what_it_does() -> None:
    for path in (*((name,) for name in COMMANDS), *((g, name) for g, names in INNER.items() for name in names)):
        usage, _, rest = help_of(*path).partition("\n\n")
        assert usage.startswith(f"Usage: main.py {' '.join(path)} ")
        assert rest.partition("\n\n")[0].strip().endswith("."), path


def test_a_help_page_waits_for_nothing_slow() -> None:
    code = f"import sys, app.cli; print([name for name in {SLOW} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.stdout.strip() == "[]", done.stderr


def test_the_window_waits_for_nothing_that_it_does_not_show_at_once() -> None:
    """Neither for what few starts need, nor for what is loaded beside it."""
    others = ("matplotlib", "jinja2", "rich", "mujoco", "openvino", "numba", "app.rig_wizard.wizard", "app.training.dialog")
    code = f"""
import sys
from app.operator import rehearsing, rig_menu, services, startup, triggers
from app.settings import apply
print([name for name in {others} if name in sys.modules])"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.stdout.strip() == "[]", done.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("perceive",), "error: Missing argument 'images'; see main.py perceive --help\n"),
        (("perceiv",), "error: No such command 'perceiv'. Did you mean 'perceive'?; see main.py --help\n"),
        (("session", "info", "{denied}"), "error: {denied}: cannot be read (Permission denied)\n"),
        (("session", "info", "{long}"), "error: {long}: cannot be read (File name too long)\n"),
        (("evaluate", "{long}", "--out", "x"), "error: {long}/annotations.lumenpilot.sqlite: File name too long\n"),
    ],
)
def test_a_command_line_that_makes_no_sense_is_one_line(
    arguments: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    names = {"denied": str(tmp_path / "denied"), "long": "n" * 300}

    def deny(self: Path) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))

    monkeypatch.setattr(sys, "argv", ["main.py", *(one.format(**names) for one in arguments)])
    with monkeypatch.context() as patch, pytest.raises(SystemExit) as left:
        if "{denied}" in arguments:  # the tests may be run by one who is denied nothing
            patch.setattr(Path, "iterdir", deny)
        main()
    assert left.value.code == 2
    assert capsys.readouterr().err == told.format(**names)


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("perceive", ""), "an argument"),
        (("perceive", "a.png", "--jsonl", ""), "--jsonl"),
        (("perceive", "a.png", "--overlay="), "--overlay"),
        (("annotate", "pictures", "--study", ""), "--study"),
        (("--config", "", "gui"), "--config"),
        (("evaluate", "--out", "o", "--csv", ""), "--csv"),
        (("perceive", "--", ""), "an argument"),
        (("annotate", "-", ""), "an argument"),
    ],
)
def test_an_empty_text_is_no_value(
    words: tuple[str, ...], what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["main.py", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    shown = capsys.readouterr()
    assert (ended.value.code, shown.out) == (2, "")
    assert shown.err == f"error: {what} is empty: give it a value, or leave it out (is a variable of a script not set?)\n"


def test_an_interrupted_command_ends_with_130(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(synth, "make_set", interrupted)
    monkeypatch.setattr(sys, "argv", ["main.py", "synth", "--out", "x", "--count", "4"])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_a_memory_fault_says_where() -> None:
    code = "import ctypes, app.cli as cli\ncli.app = lambda **_: ctypes.string_at(0)\ncli.main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode < 0
    assert "Segmentation fault" in done.stderr
    assert "string_at" in done.stderr


@pytest.mark.parametrize("errors", ["2>&-", "2>/dev/full"])
def test_without_a_standard_error_the_exit_code_is_the_same(tmp_path: Path, errors: str) -> None:
    command = f'exec "{sys.executable}" "{ROOT / "main.py"}" session info "{tmp_path / "nothing"}" {errors}'
    assert subprocess.run(["sh", "-c", command], check=False).returncode == 2


def test_the_help_of_synth_names_every_look_beside_the_ten() -> None:
    """It is written out there: whoever asks for help does not wait for the twin to be imported."""
    said = " ".join(help_of("synth").split())
    assert f"({', '.join(RARE_FAMILIES)}: drawn" in said
    assert all(f"{name}:" in said for name in (BENCH_LOOK, OWN_LOOK, PAINTED_LOOK))


def test_stream_may_have_a_port_and_need_not() -> None:
    assert bare_stream(["gui", "--stream"]) == ["gui", "--stream=0"]
    assert bare_stream(["--stream", "--lsl"]) == ["--stream=0", "--lsl"]
    assert bare_stream(["gui", "--stream", "9000"]) == ["gui", "--stream", "9000"]
    config = Config.model_validate({"stream": {"port": 9001}})
    for given, expected in ((None, (False, 9001)), (0, (True, 9001)), (9000, (True, 9000))):
        stream = with_outputs(config, given, lsl=False).stream
        assert (stream.foxglove, stream.port) == expected
