"""``make docs``: README, CHANGELOG and docs/ as plain HTML pages. They need no server, and neither does the build need a network.

Each page lies where its source does, so that a link leads to the same file in checkout and site; what is no page is copied.
"""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import dataclass, field
from html import escape
from os.path import relpath
from pathlib import Path, PurePosixPath
from typing import Annotated

import typer
from markdown_it import MarkdownIt
from markdown_it.token import Token

from core.devices import UserError
from tools.run import run_tool

ROOT = Path(__file__).resolve().parent.parent
_DOCS = ("first_day", "operating", "bench", "safety", "studies", "method", "experiments", "faults", "development")
PAGES = {name: name.replace(".md", ".html") for name in ("README.md", *(f"docs/{page}.md" for page in _DOCS), "CHANGELOG.md")}
"""Source -> page, in the order in which they are listed; the first one is the site's start."""
PAGES["README.md"] = "index.html"
_STYLE = """
:root { color-scheme: light dark; --ink: #1a1d21; --dim: #5c636d; --line: #d9dde2; --paper: #fff; --side: #f5f6f8; --link: #0060a8 }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e6e9; --dim: #9aa2ad; --line: #363b42; --paper: #16181b; --side: #1e2125; --link: #6cb8ff; }
}
* { box-sizing: border-box; }
body { margin: 0; display: flex; color: var(--ink); background: var(--paper); font: 1rem/1.55 Inter, system-ui, sans-serif; }
nav { flex: 0 0 15rem; height: 100vh; position: sticky; top: 0; overflow-y: auto; padding: 1.2rem; background: var(--side); }
nav a { display: block; padding: .2rem 0; color: inherit; } nav a.part { padding-left: 1rem; font-size: .88rem; color: var(--dim); }
nav a[aria-current] { font-weight: 650; }
main { flex: 1; min-width: 0; max-width: 62rem; padding: 1rem 2.5rem 4rem; }
a { color: var(--link); text-decoration: none; } a:hover { text-decoration: underline; }
h1, h2, h3 { line-height: 1.25; } h2 { margin-top: 2.4rem; padding-bottom: .3rem; border-bottom: 1px solid var(--line); }
img { max-width: 100%; border: 1px solid var(--line); border-radius: 4px; }
table { display: block; overflow-x: auto; border-collapse: collapse; font-size: .92rem; }
th, td { padding: .35rem .7rem; border: 1px solid var(--line); text-align: left; vertical-align: top; }
pre, code { font: .88rem/1.45 ui-monospace, monospace; background: var(--side); border-radius: 4px; }
code { padding: .1em .3em; } pre { padding: .8rem 1rem; overflow-x: auto; } pre code { padding: 0; }
@media (max-width: 50rem) { body { display: block; } nav { height: auto; position: static; } main { padding: 1rem; } }
@media print { nav { display: none; } }
"""


@dataclass
class _Page:
    title: str
    tokens: list[Token]
    parts: dict[str, str] = field(default_factory=dict)
    """Ids of the headings of the second level -> their texts."""
    ids: set[str] = field(default_factory=set)


def _read(markdown: MarkdownIt, text: str) -> _Page:
    """The page of a text, whose headings get the ids that GitHub gives them."""
    page = _Page("", markdown.parse(text))
    for heading, inline in zip(page.tokens, page.tokens[1:], strict=False):
        if heading.type == "heading_open":
            title = "".join(child.content for child in inline.children or ())
            slug = name = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
            count = 0
            while name in page.ids:
                count += 1
                name = f"{slug}-{count}"
            page.ids.add(name)
            heading.attrSet("id", name)
            page.title = page.title or title
            if heading.tag == "h2":
                page.parts[name] = title
    return page


def build(out: Path, root: Path = ROOT) -> None:
    """Write the site into the folder `out`. Raises UserError: links that lead nowhere."""
    markdown = MarkdownIt("commonmark").enable("table")
    pages = {source: _read(markdown, (root / source).read_text(encoding="utf-8")) for source in PAGES}
    broken = []
    for source, page in pages.items():
        for token in page.tokens:
            for link, name in ((child, name) for child in token.children or () for name in ("href", "src")):
                to = str(link.attrGet(name) or "")
                if not to or "://" in to:
                    continue
                path, _, part = to.partition("#")
                target = relpath(root / PurePosixPath(source).parent / path, root) if path else source
                if target in PAGES:
                    link.attrSet(name, _link(source, target) + (f"#{part}" if part else ""))
                if not (root / target).is_file() or (part and part not in pages[target].ids):
                    broken.append(f"{source}: {to}")
                elif target not in PAGES:
                    (out / target).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(root / target, out / target)
    if broken:
        raise UserError("these links lead nowhere: " + ", ".join(broken))
    for source, page in pages.items():
        entries = []
        for other, its in pages.items():
            current = ' aria-current="page"' if other == source else ""
            entries.append(f'<a href="{_link(source, other)}"{current}>{escape(its.title)}</a>')
            if current:
                entries += [f'<a class="part" href="#{part}">{escape(text)}</a>' for part, text in page.parts.items()]
        file = out / PAGES[source]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{escape(page.title)}</title><style>{_STYLE}</style></head>\n"
            f"<body><nav>{''.join(entries)}</nav>\n"
            f"<main>{markdown.renderer.render(page.tokens, markdown.options, {})}</main></body></html>\n",
            encoding="utf-8",
        )


def _link(source: str, target: str) -> str:
    """From the page of a source to that of another."""
    return relpath(PAGES[target], PurePosixPath(PAGES[source]).parent)


def main(
    out: Annotated[Path, typer.Option(help="folder of the site")] = ROOT / "out" / "site",
    new_pictures: Annotated[bool, typer.Option("--new-pictures", help="take the pictures of the windows now (minutes)")] = False,
) -> None:
    """README, CHANGELOG and docs/ as a site of HTML pages."""
    build(out)
    if new_pictures:
        from tools import screenshots

        screenshots.main(out / "docs" / "pictures")
    sys.stderr.write(f"{out / 'index.html'}\n")


if __name__ == "__main__":
    run_tool(main)
