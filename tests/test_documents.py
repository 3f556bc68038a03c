"""What the documents promise exists."""

from pathlib import Path

import pytest

from core.devices import UserError
from tools.docs_site import PAGES, ROOT, build


def test_links_lead_somewhere_and_nothing_is_left_to_fill_in(tmp_path: Path) -> None:
    assert {str(path.relative_to(ROOT)) for path in (ROOT / "docs").glob("*.md")} <= set(PAGES)
    assert not [name for name in PAGES if "@@" in (ROOT / name).read_text(encoding="utf-8")]
    build(tmp_path)
    start, page = ((tmp_path / name).read_text(encoding="utf-8") for name in ("index.html", "docs/first_day.html"))
    assert '<a href="docs/operating.html#triggers-from-other-programs">' in start
    assert '<a href="../index.html">LumenPilot</a>' in page
    assert '<h2 id="figures">' in start
    assert (tmp_path / "docs/pictures/operator_window.png").is_file()
    assert (tmp_path / "core/control/alerts.py").is_file()


def test_links_that_lead_nowhere_are_named(tmp_path: Path) -> None:
    for name in PAGES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("# One\n", encoding="utf-8")
    text = "# One\n# One\n[a](README.md#one-1), [b](docs/bench.md#two), [c](#one), [d](none.py)\n"
    (tmp_path / "README.md").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=r"nowhere: README\.md: docs/bench\.md#two, README\.md: none\.py$"):
        build(tmp_path / "out", tmp_path)
