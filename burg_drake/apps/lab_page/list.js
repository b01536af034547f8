"use strict";

// All trials with their entries, block by block.

const chips = new Map(), bars = new Map();

function buildList() {
  for (const block of new Set(plan.trials.map((trial) => trial.block))) {
    const trials = plan.trials.filter((trial) => trial.block === block);
    const title = make("h3", "", `Block ${block}: ${trials[0].scene}`), count = make("span");
    const bar = make("progress"), row = make("div", "chips");
    bar.max = trials.length;
    title.append(count);
    bars.set(block, { bar, count, trials });
    for (const { number, instance } of trials) {
      const chip = make("button", "", String(number));
      chip.title = `Trial ${number}: ${instance}`;
      chip.addEventListener("click", () => show(number));
      chips.set(number, chip);
      row.append(chip);
    }
    $("all").append(title, bar, row);
  }
}

function kindOf(entry) {
  if (!entry || !entry.outcome) return "open";
  if (["not_attempted", "perception_failed"].includes(entry.outcome)) return "untried";
  if (entry.outcome === "lifted") return "held";
  return entry.outcome.startsWith("lifted") ? "partly" : "failed";
}

const MARKS = { open: "", held: "✓", partly: "(✓)", failed: "✗", untried: "–" };

function renderList() {
  let total = 0;
  for (const [number, chip] of chips) {
    const entry = entryOf(number), kind = kindOf(entry);
    chip.className = `${kind}${entry && entry.waiting ? " waiting" : ""}`;
    chip.textContent = `${number}${MARKS[kind]}`;
    if (number === current) chip.setAttribute("aria-current", "true");
    else chip.removeAttribute("aria-current");
  }
  for (const { bar, count, trials } of bars.values()) {
    const done = trials.filter(({ number }) => (entryOf(number) || {}).outcome).length;
    bar.value = done;
    count.textContent = ` ${done} of ${trials.length}`;
    total += done;
  }
  $("progress").textContent = `${total} of ${plan.trials.length} trials done`;
}
