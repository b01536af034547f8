"""Why sampling found fewer grasps on an object than it was asked for, in words for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from burg_drake.evaluation.candidates.clear_test import PADS
from burg_drake.grasping.sampling import NO_APPROACH, NO_ROOM, SLANTED, TOO_LONG

LINES = {
    TOO_LONG: "are longer than the hand can open",
    SLANTED: "meet the surface at an angle at which a friction of {friction:g} does not hold",
    NO_ROOM: "leave no room for a finger",
    NO_APPROACH: "allow no approach within the limits",
}
"""What becomes of lines through an object, by the sampler's word for it."""
REMEDIES = {
    TOO_LONG: "a hand that opens wider would help",
    SLANTED: "more friction would help",
    NO_ROOM: "a hand with thinner fingers would help",
    NO_APPROACH: "wider limits of the approach would help",
    PADS: "smaller pads would help",
}
SELF, TABLE = "the object itself", "the table"
REMEDY_OF_TABLE = "another pose of the object, or a hand with thinner fingers, would help"
REMEDY_OF_SELF = "other directions of the approach, or a slimmer hand, would help"
REMEDY_OF_OTHERS = "more room around {body} would help"
REMEDY_OF_MARGIN = "a smaller margin would help"
BODIES = 3
"""So many bodies are named that are in the way."""


def shortfall(name: str, asked: int, provenance: Mapping[str, Any], found: int) -> str:
    """Why there are fewer grasps than asked, counted by the sampler; "" if there are not fewer.

    Args:
        name: of the instance or object.
        asked: number of grasps.
        provenance: what `sample_on_scene` or `sample_library` says of its grasps.
        found: number of grasps.
    """
    if found >= asked:
        return ""
    text = f"{name}: only {found:,} of {asked:,} grasps were found"
    lines, blocked = provenance.get("left_out", {}), provenance.get("blocked", {})
    parts, causes = [], {}
    tried = provenance.get("tried", 0)
    if tried < max(asked, 10 * found) and lines:  # it is lines that are rare
        parts.append(_of_lines(provenance))
        causes = dict(lines)
    if sum(blocked.values()):
        bodies = _named(blocked, provenance.get("target", name))
        margin = provenance.get("margin", 0.0)
        parts.append(f"of {tried:,} antipodal grasps tried, {_of_bodies(bodies, margin)}")
        causes = bodies if tried > found else causes
    if not parts:
        return text
    return f"{text}: {'; '.join(parts)}; {_remedy(causes, provenance)}"


def _named(blocked: Mapping[str, int], target: str) -> dict[str, int]:
    """Counts by what people call a body, the most first."""
    names = {target: SELF, "table": TABLE}
    counts = sorted(blocked.items(), key=lambda item: -item[1])
    return {names.get(body, body): count for body, count in counts if count}


def _of_lines(provenance: Mapping[str, Any]) -> str:
    left_out = sorted(provenance["left_out"].items(), key=lambda item: -item[1])
    friction = provenance.get("friction", math.nan)
    parts = [f"{n:,} {LINES[why].format(friction=friction)}" for why, n in left_out if n]
    return f"of {provenance['rays']:,} lines through it {_joined(parts)}"


def _of_bodies(bodies: Mapping[str, int], margin: float) -> str:
    hit = {body: n for body, n in bodies.items() if body != PADS}
    parts = [f"{body} in {n:,}" for body, n in list(hit.items())[:BODIES]]
    rest = sum(list(hit.values())[BODIES:])
    parts += [f"others in {rest:,}"] if rest else []
    meets = f"comes within {1e3 * margin:g} mm of" if margin else "hits"
    text = f"the open hand {meets} {_joined(parts)}" if parts else ""
    if bodies.get(PADS):
        text += f"{', and ' if text else ''}its pads meet the object elsewhere in {bodies[PADS]:,}"
    return text


def _remedy(causes: Mapping[str, int], provenance: Mapping[str, Any]) -> str:
    """What would help against the most frequent cause."""
    cause = max(causes, key=causes.__getitem__)
    if provenance.get("margin") and cause not in REMEDIES:
        return REMEDY_OF_MARGIN
    known = {**REMEDIES, TABLE: REMEDY_OF_TABLE, SELF: REMEDY_OF_SELF}
    return known.get(cause, REMEDY_OF_OTHERS.format(body=cause))


def _joined(parts: list[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
