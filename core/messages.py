"""Texts for people that keep the template and the values that they were made of, so that windows can translate them."""

from __future__ import annotations

from collections.abc import Mapping
from string import Formatter
from types import MappingProxyType

_NOTHING: Mapping[str, str] = MappingProxyType({})


class Message(str):
    """An English text. ``template`` is the text with {names} in the places of ``values``, which are texts, too.

    It stays a Message as the only argument of an exception: ``str(UserError(message(...)))``.
    """

    template: str
    values: Mapping[str, str]

    def __new__(cls, text: str, template: str = "", values: Mapping[str, str] = _NOTHING) -> Message:
        made = super().__new__(cls, text)
        made.template, made.values = template or text, values
        return made

    def __str__(self) -> str:
        return self

    def __reduce__(self) -> tuple[type[Message], tuple[str, str, dict[str, str]]]:
        return Message, (str.__str__(self), self.template, dict(self.values))


def message(template: str, /, **values: object) -> Message:
    """The text of a template such as ``"{joint} off by {off:.1f} mm"``. Its translation has the names without their formats."""
    plain, texts = [], {}
    for literal, name, form, conversion in Formatter().parse(template):
        plain.append(literal.replace("{", "{{").replace("}", "}}"))
        if name is not None:
            value = values[name]
            if conversion == "r":
                value = repr(value)
            texts[name] = value if isinstance(value, str) and not form else format(value, form or "")
            plain.append(f"{{{name}}}")
    own = "".join(plain)
    return Message(own.format(**texts), own, texts)
