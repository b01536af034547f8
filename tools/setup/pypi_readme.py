"""The README as PyPI shows it, where links to files of the repository lead nowhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PAGES = "https://github.com/burg-drake/burg_drake/blob/main/"
IMAGES = "https://raw.githubusercontent.com/burg-drake/burg_drake/main/"


class ReadmeHook(MetadataHookInterface):
    """Gives hatchling the README with absolute links."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Sets `readme`."""
        text = (Path(self.root) / "README.md").read_text("utf-8")
        text = re.sub(r"<!--.*?-->\n", "", text, flags=re.DOTALL)
        text = re.sub(r"(!\[[^]]*\]\()(?!https?://)", rf"\g<1>{IMAGES}", text)
        text = re.sub(r"(\]\()(?!https?://)", rf"\g<1>{PAGES}", text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
