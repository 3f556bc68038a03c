"""The language of the windows: every text has its translation, the chosen one is spoken, files stay English, nothing crashes."""

from __future__ import annotations

import ast
import json
import pickle
import re
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest
from PySide6.QtCore import QLocale, Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.annotator.panels import QueueModel
from app.operator.record_bar import RecordBar
from app.operator.window import OperatorWindow
from app.settings.apply import SettingsController
from app.ui import i18n
from app.ui.actions import LanguageMenu, plain
from app.ui.i18n import AUTO, CHINESE, ENGLISH, english_texts, language_in_use, tr, tr_text, use_language
from app.ui.texts import advice_headline
from core.annotation.model import Annotation, Status
from core.config.files import read_settings
from core.config.models import Config, QualityConfig
from core.control.alerts import ALERTS
from core.devices import UserError
from core.messages import Message, message
from core.perception.quality import check_kind, hinted
from core.session.writer import RecordStatus
from core.types import Advice, Reason, Refusal, Speed
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine
from tools import translations as translations_tool

ROOT = Path(__file__).resolve().parents[3]
TS = ROOT / "resources" / "translations" / "lumenpilot_zh_CN.ts"
HAN = re.compile("[\u4e00-\u9fff]")


@pytest.fixture
def chinese(qapp: QApplication) -> Iterator[None]:
    assert use_language(qapp, CHINESE) in ("", i18n.font_problem(CHINESE))
    yield
    use_language(qapp, ENGLISH)


@pytest.fixture
def afterwards_english(qapp: QApplication) -> Iterator[None]:
    yield
    use_language(qapp, ENGLISH)


def _placeholders(text: str) -> list[str]:
    return sorted(re.findall(r"\{[^}]*\}", text))


# ---- the files


def test_every_text_of_the_windows_is_translated_with_its_placeholders() -> None:
    translations = translations_tool.read_ts(TS)
    texts = translations_tool.texts_of_code()
    assert set(translations) == set(texts), "run make translations"
    assert not [text for text in texts if not translations[text].strip()]
    assert not [text for text in texts if _placeholders(text) != _placeholders(translations[text])]


def test_a_key_that_is_marked_in_english_is_marked_in_chinese() -> None:
    for text, translated in translations_tool.read_ts(TS).items():
        marked = re.search(r"&(\w)", text)
        if marked is not None:
            found = re.search(r"&(\w)", translated)
            assert found[1].isascii(), text


def test_the_compiled_file_is_what_lrelease_makes_of_the_texts(tmp_path: Path) -> None:
    made = translations_tool.release(TS, tmp_path / "made.qm")
    assert made.read_bytes() == TS.with_suffix(".qm").read_bytes(), "run make translations"


def test_a_new_text_stands_in_the_file_as_unfinished(tmp_path: Path) -> None:
    path = tmp_path / "lumenpilot_zh_CN.ts"
    translations_tool.write_ts(path, {"Robot & <head>": "app/a.py", "Vessel": "app/b.py"}, {"Vessel": "血管", "Gone": "没有"})
    assert translations_tool.read_ts(path) == {"Robot & <head>": "", "Vessel": "血管"}
    assert 'type="unfinished"' in path.read_text(encoding="utf-8")


def _texts_below() -> set[str]:
    """All literals of the code that makes these texts; the values of an f-string are {}."""
    found = set()
    own = ROOT / "app" / "ui" / "i18n.py"
    for path in (
        *ROOT.glob("core/**/*.py"),
        *ROOT.glob("hardware/**/*.py"),
        *ROOT.glob("app/annotator/*.py"),
        *ROOT.glob("app/commands/*.py"),
    ):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if path != own else ():
            if isinstance(node, ast.JoinedStr):
                found.add("".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return found


def test_every_listed_text_of_the_layers_below_is_one_of_theirs() -> None:
    below = _texts_below()
    assert not [text for text in i18n.FIXED if text not in below]
    everything = "\n".join(below)  # templates are composed of several of them
    assert not [text for text in i18n.TEMPLATES if any(word not in everything for word in re.findall(r"[a-z]{4,}", text))]


# ---- looking up


def test_english_stays_as_it_is_written(qapp: QApplication, afterwards_english: None) -> None:
    use_language(qapp, ENGLISH)
    assert tr("&File") == "&File"
    assert tr("{length:.0f} px to go", length=12.4) == "12 px to go"
    assert tr_text("for 120 ms") == "for 120 ms"


def test_texts_with_values_are_translated_and_filled(chinese: None) -> None:
    assert tr("{length:.0f} px to go", length=12.4) == "剩余 12 px"
    assert advice_headline(Advice(speed=Speed.SLOWEST, advance_mm_s=1.0, steer_deg=-18.0, why="")) == "极慢，左 18°"


@pytest.mark.parametrize(
    ("text", "translated"),
    [
        ("on the centerline and along it", "在中心线上且方向一致"),
        ("30 % (at least 60 %)", "30 %（至少 60 %）"),
        ("the computer slept for 12 s", "计算机休眠了 12 s"),
        ("the pedal at /dev/x is gone (EIO): plug its USB cable in", "脚踏板 /dev/x 断开（EIO）：插好其 USB 线"),
        (
            "/x/settings.toml: is no TOML (Expected '='); it is kept as settings.toml.bad-1, and the defaults are used",
            "/x/settings.toml：不是 TOML 文件（Expected '='）；文件保留为 settings.toml.bad-1，并使用默认值",
        ),
        ("something that nobody has listed", "something that nobody has listed"),
        ("", ""),
    ],
)
def test_texts_of_the_layers_below_are_translated_where_they_are_known(chinese: None, text: str, translated: str) -> None:
    assert tr_text(text) == translated


def test_a_text_is_taken_by_the_template_that_made_it() -> None:
    """And not by a shorter one, which would leave half of it in English."""
    for template in i18n.templates_below():
        text = re.sub(r"\{(\w+)\}", lambda found: "5" if len(found[1]) == 1 else "/dev/ttyUSB0", template)
        assert next(one for one, pattern in i18n._patterns() if pattern.fullmatch(text)) == template


@pytest.mark.parametrize(
    "detail",
    [
        "highest robot probability 0.28",
        "highest robot probability 0.71, but only in specks",
        "what looks like it covers 41 % of the image (at most 30 %)",
    ],
)
def test_a_refusal_with_a_hint_at_the_pictures_kind_is_translated(chinese: None, detail: str) -> None:
    told = hinted(Refusal(Reason.NO_ROBOT, detail), check_kind(2.34, QualityConfig())).detail
    assert told.startswith(detail)
    assert "2.34" in told
    assert re.search("[A-Za-z]", tr_text(told)) is None
    assert re.search("[A-Za-z]", tr_text(detail)) is None


def test_a_message_is_translated_by_its_template_also_from_an_error_and_a_pipe(chinese: None) -> None:
    made = message("the computer slept for {a:.0f} s", a=12.3)
    assert (made, made.template, dict(made.values)) == ("the computer slept for 12 s", "the computer slept for {a} s", {"a": "12"})
    for text in (made, str(UserError(made)), pickle.loads(pickle.dumps(made))):
        assert isinstance(text, Message)
        assert tr_text(text) == "计算机休眠了 12 s"


def test_what_is_kept_is_english_whatever_the_window_speaks(chinese: None) -> None:
    with english_texts():
        assert tr("&File") == "&File"
        assert tr_text("for 120 ms") == "for 120 ms"
    assert tr("&File") == "文件(&F)"


# ---- choosing


@pytest.mark.parametrize(
    ("names", "spoken"),
    [
        (["zh-Hans-CN", "zh-CN", "zh"], CHINESE),
        (["zh_CN"], CHINESE),
        (["de-DE", "zh-CN"], ENGLISH),
        ([], ENGLISH),
    ],
)
def test_as_the_system_says(
    qapp: QApplication, afterwards_english: None, monkeypatch: pytest.MonkeyPatch, names: list[str], spoken: str
) -> None:
    monkeypatch.setattr(QLocale, "uiLanguages", lambda _self, *_separator: names)
    assert use_language(qapp, AUTO) == ""
    assert language_in_use() == spoken
    assert tr("&File") == ("&File" if spoken == ENGLISH else "文件(&F)")


@pytest.mark.parametrize("damage", ["missing", "cut"])
def test_a_damaged_translation_is_english_and_one_line(
    qapp: QApplication, afterwards_english: None, tmp_path: Path, damage: str
) -> None:
    path = tmp_path / "lumenpilot_zh_CN.qm"
    if damage == "cut":
        whole = TS.with_suffix(".qm").read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
    line = use_language(qapp, CHINESE, tmp_path)
    assert tr("&File") == "&File"
    assert language_in_use() == ENGLISH
    assert "\n" not in line
    assert "resources/translations" in line


# ---- the window


def _menu_texts(window: OperatorWindow) -> list[str]:
    texts = []
    for action in window.menuBar().actions():
        menu = action.menu()
        texts += [plain(action.text()), *(plain(entry.text()) for entry in menu.actions() if not entry.isSeparator())]
    return texts


def test_the_window_opens_in_chinese_and_what_is_recorded_is_english(
    chinese: None, make_window: MakeWindow, bench: FakeBench, qtbot: QtBot, tmp_path: Path
) -> None:
    config = Config.model_validate({"record": {"folder": str(tmp_path), "ring_s": 0}})
    window = make_window(lambda _config: FakeEngine(bench), config)
    window.start()
    qtbot.waitUntil(lambda: window.shown_tick is not None)
    panels = window.panels
    assert all(HAN.search(text) for text in _menu_texts(window))
    qtbot.waitUntil(lambda: bool(HAN.search(panels.badge.why)))
    for text in (
        panels.badge.why,
        panels.advice.text,
        panels.mode_bar.text,
        panels.mode_bar.stop.text(),
        panels.mode_bar.main.text(),
    ):
        assert HAN.search(text), text
    assert panels.pages.tabText(0) == "驾驶"
    panels.help.toggle()
    assert all(HAN.search(title) and all(HAN.search(text) for _, text in rows) for title, rows in panels.help.tables)
    window.recorder.toggle()
    qtbot.waitUntil(lambda: window.recorder.status.frames > 5)
    window.choose_target(100.0, 100.0)
    window.recorder.toggle()
    qtbot.waitUntil(lambda: window.recorder.status.saved is not None)
    (session,) = tmp_path.glob("session_*")
    assert json.loads((session / "frames.jsonl").read_text(encoding="utf-8").splitlines()[0])
    for path in session.glob("*.json*"):
        assert not HAN.search(path.read_text(encoding="utf-8")), path.name


def test_counts_of_the_record_bar_and_statuses_of_the_queue_are_looked_up(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(i18n._IN_USE, "lookup", lambda text: f"<{text}>")
    bar = RecordBar()
    qtbot.addWidget(bar)
    bar.show_status(RecordStatus(recording=True, dropped=5))
    assert "<5 dropped>" in bar.text
    for status in Status:
        items = Mock(**{"status.return_value": status, "is_short.return_value": False, "content.return_value": Annotation()})
        queue = QueueModel(["a.png"], items)
        assert queue.index(0).data(Qt.ItemDataRole.ToolTipRole) == f"1: a.png: <{status.value}>"


def test_every_alert_is_chinese(chinese: None) -> None:
    for spec in ALERTS.values():
        assert HAN.search(tr(spec.text))
        assert HAN.search(tr(spec.what_to_do))


# ---- the menu


def _language_menu(window: OperatorWindow) -> LanguageMenu:
    (menu,) = window.findChildren(LanguageMenu)
    return menu


def test_the_choice_is_kept_and_said_in_both_languages(make_window: MakeWindow, tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text("# mine\n[advice]\nfast_mm_s = 7.0\n", encoding="utf-8")
    window = make_window()
    desk = SettingsController(window, read_settings(path), lambda *_asked: None)
    menu = _language_menu(window)
    assert [action.text() for action in menu.actions()] == ["As the &system says", "English", "中文"]
    assert [action.isChecked() for action in menu.actions()] == [True, False, False]
    menu.actions()[2].trigger()
    kept = read_settings(path)
    assert kept.config.window.language == CHINESE
    assert kept.config.advice.fast_mm_s == 7.0
    assert kept.text is not None
    assert "# mine" in kept.text
    assert "next start" in window.panels.toast.text() or "fonts-noto-cjk" in window.panels.toast.text()
    assert tr("&File") == "&File"
    menu.actions()[0].trigger()
    assert read_settings(path).config.window.language == AUTO
    desk.close()


def test_a_choice_that_cannot_be_kept_is_said_and_taken_back(make_window: MakeWindow, tmp_path: Path) -> None:
    folder = tmp_path / "file"
    folder.write_text("no folder", encoding="utf-8")
    window = make_window()
    desk = SettingsController(window, read_settings(folder / "settings.toml"), lambda *_asked: None)
    menu = _language_menu(window)
    menu.actions()[1].trigger()
    assert "cannot be written" in window.panels.toast.text()
    assert menu.actions()[0].isChecked()
    desk.close()
