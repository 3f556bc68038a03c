"""The base of all sections of configuration and rig files, and how a wrong value is reported."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator


class ConfigSection(BaseModel):
    """Frozen; unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def ignored(*keys: str) -> Any:
    """Settings of earlier versions, which files may still have, as a validator of their section."""

    def drop(cls: type, values: Any) -> Any:
        return {key: value for key, value in values.items() if key not in keys} if isinstance(values, dict) else values

    return model_validator(mode="before")(drop)


def plain_message(error: dict[str, Any] | Any) -> str:
    """Pydantic's message of one error without its prefix."""
    return str(error["msg"]).removeprefix("Value error, ")


def first_problem(error: ValidationError) -> str:
    """The first error of a validation in one line: key, message, and how many more there are."""
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"{key + ': ' if key else ''}{plain_message(first)}{more}"
