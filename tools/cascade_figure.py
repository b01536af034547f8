"""Draws docs/images/cascade.svg: outcomes by stage. Run `python -m tools.cascade_figure`."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core import Outcome, Stage

OUT = Path(__file__).parents[1] / "docs" / "images" / "cascade.svg"
QUESTIONS = {
    Stage.CLEAR: "Is the open hand free at the grasp?",
    Stage.REACHABLE: "Can hand and arm be there?",
    Stage.PLANNED: "Can the arm move there and up?",
    Stage.EXECUTED: "Does the simulated hand lift it?",
}
SUCCESSES = (Outcome.LIFTED, Outcome.REACHABLE)
BOX, GAP, TOP, LINE = 230, 28, 44, 17  # pixels
STYLE = (
    "text{font:13px sans-serif;fill:#24292f}.b{font-weight:600}.s{font-size:12px;fill:#57606a}"
    ".q{font-size:11.5px}rect{fill:#ddebfa;stroke:#2a6fb0}.good{fill:#d9f0dd;stroke:#2c8a3d}"
    "path{stroke:#2a6fb0;stroke-width:2;fill:none}.no{stroke:#b4452c}"
)


def draw() -> str:
    """The figure as SVG."""
    parts = []
    longest = 0
    for k, (stage, question) in enumerate(QUESTIONS.items()):
        x = GAP + k * (BOX + GAP)
        lost = [o.value for o in Outcome if o.stage == stage and o not in SUCCESSES]
        longest = max(longest, len(lost))
        parts += [
            f'<rect x="{x}" y="{TOP}" width="{BOX}" height="56" rx="6"/>',
            f'<text class="b" x="{x + 10}" y="{TOP + 23}">{stage.value}</text>',
            f'<text class="q" x="{x + 10}" y="{TOP + 43}">{question}</text>',
            f'<path d="M{x - GAP} {TOP + 28}H{x - 3}m-6 -5l6 5l-6 5"/>',
            f'<path class="no" d="M{x + 20} {TOP + 56}v22m-5 -6l5 6l5 -6"/>',
        ]
        for i, name in enumerate(lost):
            parts.append(f'<text class="s" x="{x + 10}" y="{TOP + 100 + i * LINE}">{name}</text>')
    x = GAP + len(QUESTIONS) * (BOX + GAP)
    parts += [
        f'<path d="M{x - GAP} {TOP + 28}H{x - 3}m-6 -5l6 5l-6 5"/>',
        f'<rect class="good" x="{x}" y="{TOP}" width="80" height="56" rx="6"/>',
        f'<text class="b" x="{x + 20}" y="{TOP + 33}">lifted</text>',
        f'<text x="{GAP}" y="26">candidate grasps: yes goes right, no goes down</text>',
    ]
    width, height = x + 80 + GAP, TOP + 110 + longest * LINE
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="The stages of the cascade">\n<style>{STYLE}</style>\n'
        f'<rect width="100%" height="100%" style="fill:#fff;stroke:none"/>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    OUT.write_text(draw(), encoding="utf-8")
