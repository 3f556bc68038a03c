"""``make translations``: brings resources/translations/*.ts up to date with the code, and makes the .qm files of them.

Texts are the literals in ``tr("...")`` and ``mark("...")`` in app/, those in ``message("...")`` and in errors with values in core/
and hardware/ (without the formats of the values), and the lists in app/ui/i18n.py, all in one context. A text that is new stands in
the .ts as unfinished; one that is gone from the code goes from the .ts. The .qm is made by Qt's lrelease.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import escape

from app.ui.i18n import FIXED, TEMPLATES, texts_of_tables

ROOT = Path(__file__).resolve().parent.parent

FOLDER = ROOT / "resources" / "translations"
CONTEXT = "LumenPilot"
MARKS = {"tr", "mark"}
_FORMAT = re.compile(r"\{(\w+)[!:][^}]*\}")


def texts_of_code(root: Path = ROOT) -> dict[str, str]:
    """Every text to translate, and the file (relative to `root`) that has it first."""
    found: dict[str, str] = {}
    for folder, names in (("app", MARKS), ("core", {"message"}), ("hardware", {"message"})):
        for path in sorted((root / folder).rglob("*.py")):
            for text in _texts_of(path, names):
                found.setdefault(_FORMAT.sub(r"{\1}", text) if folder != "app" else text, path.relative_to(root).as_posix())
    for text in (*FIXED, *TEMPLATES):
        found.setdefault(text, "app/ui/i18n.py")
    for text in texts_of_tables():
        found.setdefault(text, "app/ui/i18n.py")
    return {text: file for text, file in found.items() if any(letter.isalpha() for letter in text)}


def _texts_of(path: Path, names: set[str]) -> Iterator[str]:
    """The literals that are the first argument of a call of one of these functions, or a template with the call's own values."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args and isinstance(node.args[0], ast.Constant):
            text, values = node.args[0].value, {keyword.arg for keyword in node.keywords}
            is_template = names != MARKS and bool(values) and values == set(re.findall(r"\{(\w+)", str(text)))
            if isinstance(text, str) and (node.func.id in names or is_template):
                yield text


def read_ts(path: Path) -> dict[str, str]:
    """The translations that are there, by their English text; unfinished ones are empty. An empty file has none."""
    if not path.is_file() or not path.stat().st_size:
        return {}
    messages = ET.parse(path).getroot().iter("message")  # our own file
    return {message.findtext("source") or "": _finished(message.find("translation")) for message in messages}


def _finished(translation: ET.Element | None) -> str:
    if translation is None or translation.get("type") == "unfinished":
        return ""
    return translation.text or ""


def write_ts(path: Path, texts: dict[str, str], translations: dict[str, str]) -> None:
    """The file, in the order of the code's files; a comment at its head (the glossary) stays."""
    old = path.read_text(encoding="utf-8") if path.is_file() else ""
    comment = old[old.index("<!--") : old.index("-->") + 3] + "\n" if "<!--" in old and "-->" in old else ""
    language = path.stem.partition("_")[2]
    lines = ['<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE TS>\n', comment]
    lines.append(f'<TS version="2.1" language="{language}" sourcelanguage="en">\n<context>\n    <name>{CONTEXT}</name>\n')
    for text, file in texts.items():
        translated = translations.get(text, "")
        kind = "" if translated else ' type="unfinished"'
        lines.append(
            f'    <message>\n        <location filename="../../{file}"/>\n        <source>{escape(text)}</source>\n'
            f"        <translation{kind}>{escape(translated)}</translation>\n    </message>\n"
        )
    lines.append("</context>\n</TS>\n")
    path.write_text("".join(lines), encoding="utf-8")


def release(path: Path, out: Path | None = None) -> Path:
    """The .qm of a .ts, by the lrelease that comes with PySide6. Raises CalledProcessError."""
    import PySide6

    made = out or path.with_suffix(".qm")
    tool = Path(PySide6.__file__).parent / "lrelease"
    subprocess.run([tool, "-silent", path, "-qm", made], check=True)
    return made


def main() -> int:
    texts = texts_of_code()
    for path in sorted(FOLDER.glob("*.ts")):
        write_ts(path, texts, read_ts(path))
        missing = [text for text, translated in read_ts(path).items() if not translated]
        release(path)
        sys.stdout.write(f"{path.name}: {len(texts)} texts, {len(missing)} not translated\n")
        sys.stdout.writelines(f"    {texts[text]}: {text!r}\n" for text in missing)
    return 0


if __name__ == "__main__":
    sys.exit(main())
