"""Settings as people and programs write them: `part.key=value`, plain values, and the parts that a step reads."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError

from dreamfields_core.config.concerns import DreamConfig
from dreamfields_core.config.fields import FIELD_KINDS


class ConfigError(ValueError):
    """A setting that cannot be; its text is one sentence with the way out."""


def parts(config: DreamConfig, names: tuple[str, ...]) -> dict[str, Any]:
    """The named parts as JSON-able values: what a step's cache key is made of. A name may be dotted, "guidance.name"."""
    dumped = config.model_dump(mode="json")

    def pick(name: str) -> Any:
        value: Any = dumped
        for step in name.split("."):
            value = value[step]
        return value

    return {name: pick(name) for name in names}


def override(config: DreamConfig, assignments: tuple[str, ...]) -> DreamConfig:
    """Apply `part.key=value` assignments, the value read as JSON where it is JSON, else as text.

    Raises:
      ConfigError: an assignment without "=", an unknown key or an impossible value.
    """
    values = config.model_dump(mode="json")
    # The kind of field comes first, wherever it stands: what is said of the field is said of that kind.
    for assignment in sorted(assignments, key=lambda assignment: assignment.partition("=")[0].strip() != "field.kind"):
        key, equals, text = assignment.partition("=")
        if not equals or not key.strip():
            raise ConfigError(f'expected part.key=value, got "{assignment}": write for instance --set mesh.faces=5000')
        _assign(values, key.strip(), _read(text.strip()), assignment)
    return validate(values)


def validate(values: dict[str, Any]) -> DreamConfig:
    """Build a config from plain values.

    Raises:
      ConfigError: one sentence naming the first setting that cannot be, what was expected, and what came.
    """
    try:
        return DreamConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        # Neither the kind of a field nor an item of a list is a setting that could be changed by name.
        named = [step for step in first["loc"] if isinstance(step, str) and step not in FIELD_KINDS]
        place = ".".join(named + ["kind"] * first["type"].startswith("union_tag")) or "config"
        problem = first["msg"].removeprefix("Value error, ")
        problem = problem[0].lower() + problem[1:]
        if first["type"] == "extra_forbidden":
            raise ConfigError(f'there is no setting "{place}": `dreamfields settings` lists those there are') from None
        if first["type"] == "value_error":
            raise ConfigError(f"{place}: {problem}") from None
        raise ConfigError(f"{place}: {problem}, got {_brief(first['input'])}; change it with --set {place}=VALUE") from None


def _brief(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _read(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def _assign(values: dict[str, Any], key: str, value: Any, assignment: str) -> None:
    *path, last = key.split(".")
    place: Any = values
    for name in path:
        if not isinstance(place, dict) or name not in place:
            raise ConfigError(f'there is no setting "{key}" (in "{assignment}"): `dreamfields settings` lists those there are')
        place = place[name]
    if not isinstance(place, dict) or last not in place:
        raise ConfigError(f'there is no setting "{key}" (in "{assignment}"): `dreamfields settings` lists those there are')
    if key == "field.kind" and place[last] != value:
        # Another kind has other settings: the ones of the old kind mean nothing to it.
        values["field"] = validate(values | {"field": {"kind": value}}).model_dump(mode="json")["field"]
    else:
        place[last] = value
