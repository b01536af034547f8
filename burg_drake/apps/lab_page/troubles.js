"use strict";

// Unsaved entries, the reasons, and what the user can do about them.

function renderTroubles() {
  const { troubled, stuck } = outbox, told = [...troubled, ...stuck];
  const key = JSON.stringify(told.map(({ id, trouble, refused }) => [id, trouble, refused && refused.text]));
  if ($("troubles").dataset.key === key) return;  // buttons stay while somebody reads
  $("troubles").dataset.key = key;
  $("troubles").hidden = !told.length;
  $("troubles").replaceChildren(...troubled.map(troubleOf), ...stuck.map(stuckOf));
}

function troubleOf(item) {
  const { entry, trouble } = item, mine = wordOf(entry);
  const line = make("li", "", `Trial ${entry.number}, ${mine}, is not saved: ${trouble.text}. `);
  line.append(dropButton(item, trouble.state ? "Keep theirs" : "Discard"));
  if (trouble.state) {
    const insist = make("button", "", `Save ${mine} instead`);
    insist.addEventListener("click", () => outbox.insist(item));
    line.append(insist);
  }
  return line;
}

function stuckOf(item) {
  const { entry, refused } = item;
  const line = make("li", "", `Trial ${entry.number}, ${wordOf(entry)}, cannot be saved yet: ${refused.text}. It is sent again until it is saved. `);
  line.append(dropButton(item, "Discard"));
  return line;
}

function wordOf(entry) { return entry.outcome ? labelOf(entry.outcome) : "entry deleted"; }

function dropButton(item, text) {
  const drop = make("button", "", text);
  drop.addEventListener("click", () => outbox.discard(item));
  return drop;
}
