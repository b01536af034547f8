"""Writes model files into the checkout."""

from __future__ import annotations

from pathlib import Path

MODELS = Path(__file__).resolve().parents[2] / "models"


def write_models(texts: dict[str, str]) -> None:
    """Writes texts to their paths below `models` and says how large they are."""
    for relative, text in texts.items():
        path = MODELS / relative
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        print(f"{len(text.encode()) / 1e3:8.1f} kB  {path}")
    print(f"{sum(len(text.encode()) for text in texts.values()) / 1e6:8.2f} MB")
