"use strict";

// What the viewer enters, and takes back.

function enter(outcome) {
  if (!current || performance.now() - shownSince < SETTLE) return;  // a second tap of the same
  const number = current;
  put(number, fields(outcome));
  show(firstOpen(number));
}

function fields(outcome) {
  const width = Number.parseFloat($("width").value.replace(",", "."));
  return {
    outcome,
    time: now(),
    operator: $("operator").value.trim(),
    note: $("note").value.trim(),
    width_mm: Number.isFinite(width) && width >= 0 ? width : null,
  };
}

function put(number, values, undoable = true) {
  const known = entries.get(number), was = entryOf(number);
  const { outcome, operator, note, width_mm, time } = was;
  const before = undoable ? { outcome, operator, note, width_mm, time } : null;
  outbox.add({ plan: plan.plan, number, ...values }, known.state, before);
}

function undo() {
  const last = history.pop();
  if (!last) return;
  put(last.number, { ...last.before, time: last.before.time || now() }, false);
  show(last.number);
}

function now() {  // as people here write the time, with its zone
  const moment = new Date(), zone = -moment.getTimezoneOffset();
  const local = new Date(moment.getTime() + 60000 * zone).toISOString().slice(0, 19);
  const two = (value) => String(Math.floor(Math.abs(value))).padStart(2, "0");
  return `${local}${zone < 0 ? "-" : "+"}${two(zone / 60)}:${two(zone % 60)}`;
}
