"""The dialog: fields from the schema, search, marks, resets; it works by keyboard and Space is left to STOP."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from app.settings.dialog import SettingsDialog
from app.settings.draft import SettingsDraft
from app.settings.fields import SettingField
from core.config.models import Config, load_config
from core.config.schema import schema, settings_by_key

D_ALLOW, THETA = "perception.pose.d_allow_px", "perception.pose.theta_allow_deg"
Key = Qt.Key


@pytest.fixture
def dialog(qtbot: QtBot, themed: None) -> SettingsDialog:
    made = SettingsDialog(SettingsDraft(load_config()), Path("settings.toml"))
    made.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, False)
    qtbot.addWidget(made)
    made.show()
    return made


def drafts(dialog: SettingsDialog) -> list[Config]:
    seen: list[Config] = []
    dialog.drafted.connect(seen.append)
    return seen


def field(dialog: SettingsDialog, key: str) -> SettingField:
    dialog.go_to(key)
    return dialog.page.fields[key]


def type_into(dialog: SettingsDialog, key: str, text: str) -> SettingField:
    shown = field(dialog, key)
    editor = shown.editor
    editor.selectAll()
    QTest.keyClicks(editor, text)
    return shown


def test_every_section_has_its_page_with_every_setting(dialog: SettingsDialog) -> None:
    """But for six of the seven joints, which are all alike."""
    seen: set[str] = set()
    for section in schema().walk():
        if section.key and (not section.key.startswith("servos.joints.") or section.key.endswith(".0")):
            dialog.show_section(section)
            dialog.page.add_all()
            seen |= set(dialog.page.fields)
    assert seen == {key for key in settings_by_key() if not key.startswith("servos.joints.") or ".0." in key}


def test_a_field_shows_unit_default_range_and_meaning(dialog: SettingsDialog) -> None:
    shown = field(dialog, D_ALLOW)
    texts = " ".join(label.text() for label in shown.findChildren(type(shown.error))).replace("\N{NO-BREAK SPACE}", " ")
    for words in ("Allowed distance", "px", "Default 6 px", "above 0 and at most 200 px", "Distance of head and tail"):
        assert words in texts
    assert shown.editor.accessibleName() == "Allowed distance, px"
    assert shown.toolTip() == D_ALLOW


def test_typing_is_checked_at_once_and_marked(dialog: SettingsDialog) -> None:
    seen = drafts(dialog)
    shown = type_into(dialog, D_ALLOW, "9")
    assert seen[-1].perception.pose.d_allow_px == 9.0
    assert shown.property("changed")
    assert dialog.save.isEnabled()
    assert "picture shows it already" in dialog.status.text()
    type_into(dialog, D_ALLOW, "900")
    assert shown.error.text().endswith("must be above 0 and at most 200 px")
    assert not dialog.save.isEnabled()
    assert D_ALLOW in dialog.status.text()
    assert seen[-1].perception.pose.d_allow_px == 90.0, "the last one that was allowed"
    shown.reset_button.click()
    assert not shown.property("changed")
    assert shown.error.text() == ""
    assert seen[-1] == load_config()


def test_escape_asks_before_changes_are_lost(dialog: SettingsDialog) -> None:
    type_into(dialog, D_ALLOW, "9")
    QTest.keyClick(dialog.page.fields[D_ALLOW].editor, Key.Key_Escape)
    assert dialog.isVisible()
    assert dialog.question.text == "Leave without saving the changes?"
    assert not dialog.status.isVisible()
    assert not dialog.cancel.isVisible(), "there is one Cancel, and it goes on"
    QTest.keyClick(dialog.question._no, Key.Key_Escape)
    assert dialog.question.text == ""
    assert dialog.status.isVisible()
    assert dialog.cancel.isVisible()
    assert dialog.draft.is_dirty, "nothing was lost"
    QTest.keyClick(dialog, Key.Key_Escape)
    dialog.question._yes.click()
    assert not dialog.isVisible()
    assert dialog.result() == SettingsDialog.DialogCode.Rejected


def test_without_changes_nobody_is_asked_and_cancel_and_the_cross_ask_nobody(dialog: SettingsDialog) -> None:
    QTest.keyClick(dialog, Key.Key_Escape)
    assert not dialog.isVisible()
    for leave in (dialog.cancel.click, dialog.close):
        dialog.show()
        type_into(dialog, D_ALLOW, "9")
        leave()
        assert not dialog.isVisible()


def test_the_tree_tells_where_something_differs_or_is_wrong(dialog: SettingsDialog) -> None:
    type_into(dialog, D_ALLOW, "9")
    assert dialog._items["perception.pose"].text(1).endswith("1")
    assert dialog._items["perception"].text(1).endswith("1")
    assert dialog._items["safety"].text(1) == ""
    type_into(dialog, THETA, "999")
    assert dialog._items["perception.pose"].text(1) == "\N{WARNING SIGN}"
    assert dialog._items["perception.pose"].data(0, Qt.ItemDataRole.AccessibleTextRole).endswith("not allowed")


def test_the_problem_below_leads_to_its_field(dialog: SettingsDialog) -> None:
    type_into(dialog, D_ALLOW, "900")
    dialog.show_section(next(s for s in schema().walk() if s.key == "record"))
    dialog.status.linkActivated.emit(D_ALLOW)
    assert dialog.focusWidget() is dialog.page.fields[D_ALLOW].editor


def test_search_shows_what_fits_from_all_sections(dialog: SettingsDialog, qtbot: QtBot) -> None:
    QTest.keyClick(dialog, Key.Key_F, Qt.KeyboardModifier.ControlModifier)
    assert dialog.focusWidget() is dialog.search
    QTest.keyClicks(dialog.search, "threshold")
    qtbot.waitUntil(lambda: "perception.gaps.gap_threshold_px" in dialog.page.fields)
    assert "perception.segmentation.vessel_threshold" in dialog.page.fields
    dialog.search.setText("zebra")
    qtbot.waitUntil(lambda: not dialog.page.fields)
    QTest.keyClick(dialog.search, Key.Key_Escape)
    assert dialog.isVisible(), "Escape clears the search first"
    qtbot.waitUntil(lambda: bool(dialog.page.fields))


def test_resets_of_section_and_of_all(dialog: SettingsDialog) -> None:
    type_into(dialog, D_ALLOW, "9")
    type_into(dialog, "advice.fast_mm_s", "9")
    dialog.page.reset_asked.emit([setting.key for setting in settings_by_key().values() if setting.key.startswith("advice.")])
    assert dialog.draft.value("advice.fast_mm_s") == 8.0
    assert dialog.draft.value(D_ALLOW) == 9.0
    dialog.reset_all.click()
    assert dialog.question.text == "Put all settings back to their defaults?"
    assert dialog.draft.value(D_ALLOW) == 9.0, "asked first"
    dialog.question._on_yes()
    assert dialog.draft.config == load_config()


def test_switches_and_choices_work_by_enter_and_say_what_they_are(dialog: SettingsDialog) -> None:
    shown = field(dialog, "perception.tracking.enabled")
    QTest.keyClick(shown.editor, Key.Key_Return)
    assert dialog.draft.value("perception.tracking.enabled") is False
    assert shown.editor.text() == "off"
    choice = field(dialog, "perception.gaps.rule")
    choice.editor.setCurrentIndex(1)
    assert dialog.draft.value("perception.gaps.rule") == "every_pair"


def test_a_slider_is_there_for_what_acts_at_once_and_nowhere_else(dialog: SettingsDialog) -> None:
    shown = field(dialog, D_ALLOW)
    shown.slider.setValue(1000)
    assert dialog.draft.value(D_ALLOW) == 200.0
    shown.slider.setValue(0)
    assert not dialog.draft.error(D_ALLOW)
    assert 0.0 < dialog.draft.value(D_ALLOW) < 0.1, "0 itself is not allowed, and not offered"
    assert field(dialog, "advice.fast_mm_s").slider is None


def test_what_was_wrong_with_the_file_is_shown(qtbot: QtBot, themed: None) -> None:
    made = SettingsDialog(SettingsDraft(load_config()), Path("x.toml"), ("x.toml: future: unknown key",))
    made.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, False)
    qtbot.addWidget(made)
    made.show()
    assert "future: unknown key" in made.notice.text()


def test_a_locked_dialog_says_why_and_changes_nothing(dialog: SettingsDialog) -> None:
    type_into(dialog, D_ALLOW, "9")
    dialog.reset_all.click()
    dialog.lock("The robot is armed")
    dialog.question._on_yes()
    assert dialog.draft.value(D_ALLOW) == 9.0
    assert "The robot is armed" in dialog.status.text()
    assert not dialog.page.isEnabled()
    assert not dialog.save.isEnabled()
    assert dialog.cancel.isEnabled()
    dialog.lock("")
    assert dialog.save.isEnabled()


def test_enter_in_a_field_saves_nothing_and_restart_is_offered_only_for_what_needs_it(dialog: SettingsDialog) -> None:
    asked: list[bool] = []
    dialog.save_asked.connect(asked.append)
    QTest.keyClick(type_into(dialog, D_ALLOW, "9").editor, Key.Key_Return)
    assert asked == []
    assert dialog.isVisible()
    assert not dialog.save_and_restart.isVisible()
    type_into(dialog, "advice.fast_mm_s", "9")
    assert dialog.save_and_restart.isVisible()
    dialog.save_and_restart.setFocus()
    QTest.keyClick(dialog.save_and_restart, Key.Key_Return)
    dialog.save.click()
    assert asked == [True, False]


def test_a_folder_is_chosen_on_the_disk(dialog: SettingsDialog, tmp_path: Path) -> None:
    seen = drafts(dialog)
    chooser = field(dialog, "record.folder").browse_button
    chooser.click()
    (chosen,) = dialog.findChildren(QFileDialog)
    assert not chosen.isModal(), "STOP must stay in reach"
    chosen.filesSelected.emit([str(tmp_path)])
    chosen.reject()
    assert seen[-1].record.folder == str(tmp_path)
    editor = dialog.page.fields["record.folder"].editor
    assert editor.text() == str(tmp_path)
