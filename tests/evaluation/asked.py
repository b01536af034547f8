"""Arguments of `evaluate` one by one, as tests vary them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from burg_drake.evaluation import EvaluationSettings

SETTINGS = {field.name for field in fields(EvaluationSettings)}


def asked(**options: Any) -> dict[str, Any]:
    """The same with those that are settings in their object."""
    settings = EvaluationSettings(**{k: v for k, v in options.items() if k in SETTINGS})
    return {"settings": settings, **{k: v for k, v in options.items() if k not in SETTINGS}}
