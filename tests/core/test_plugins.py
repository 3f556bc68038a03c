"""Names that packages add by entry points: found, checked without an import, and blamed by their package."""

from pathlib import Path

import pytest

from core.plugins import PluginError, PluginKind

KIND = PluginKind("drives", ("own",), ("open", "stop"))


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> PluginKind:
    """A package of drives: one that works, and each way to fail."""
    names = {"good": "Good", "own": "Good", "absent": "Absent", "half": "half", "raises": "raises", "refuses": "refuses"}
    info = tmp_path / "bench_drives-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bench-drives\nVersion: 1.2\n")
    lines = [f"{name} = bench_drives_of_test:{target}" for name, target in names.items()]
    (info / "entry_points.txt").write_text("\n".join(["[lumenpilot.drives]", *lines, "gone = no_such_module_of_test:x"]))
    (tmp_path / "bench_drives_of_test.py").write_text(
        "from core.devices import DeviceError\n\nhalf = dict\n"
        "class Good:\n    def open(self): ...\n    def stop(self): ...\n"
        "def raises():\n    raise KeyError('port')\n"
        "def refuses():\n    raise DeviceError('plug it in')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    return KIND


def test_names_are_the_programs_own_then_those_of_plugins(installed: PluginKind) -> None:
    assert installed.names == ("own", "absent", "gone", "good", "half", "raises", "refuses")
    assert installed.check("own") == "own"
    assert installed.check("gone") == "gone", "a check imports nothing"
    with pytest.raises(ValueError, match=r"^must be one of own, absent, gone, .*; others come with the package of a plugin$"):
        installed.check("god")


def test_a_plugin_is_made_by_what_its_entry_point_names(installed: PluginKind) -> None:
    assert type(installed.make("good")).__name__ == "Good"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("gone", "ModuleNotFoundError: No module named 'no_such_module_of_test'"),
        ("absent", "AttributeError: module 'bench_drives_of_test' has no attribute 'Absent'"),
        ("half", "TypeError: what it makes has no open, stop"),
        ("raises", "KeyError: 'port'"),
    ],
)
def test_a_plugin_that_fails_is_one_line_with_its_package(name: str, told: str, installed: PluginKind) -> None:
    with pytest.raises(PluginError) as failed:
        installed.make(name)
    assert str(failed.value) == f"plugin {name} of the package bench-drives 1.2 failed ({told}); ask its author, or uninstall it"


def test_what_a_plugin_tells_the_user_stays_as_it_is(installed: PluginKind) -> None:
    with pytest.raises(Exception, match="plug it in"):
        installed.make("refuses")


def test_a_name_that_is_not_installed_is_no_traceback() -> None:
    with pytest.raises(PluginError, match=r"^other: no such plugin among drives; there are: own$"):
        KIND.make("other")
