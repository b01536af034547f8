"use strict";

// Entering and undoing outcomes.

function enter(outcome) {
  if (!current || performance.now() - shownSince < CLICK_GUARD_TIME) return;  // a second tap of the same
  if (!requireWidth()) return;
  const number = current;
  put(number, fields(outcome));
  show(firstOpen(number));
}

// The typed width [mm]; null if the field is empty, NaN if it is not a valid width.
function typedWidth() {
  const text = $("width").value.trim().replace(/\s*mm$/, "").replace(",", ".");
  if (!text) return null;
  return /^\d*\.?\d+$|^\d+\.$/.test(text) && Number(text) <= MAX_WIDTH ? Number(text) : Number.NaN;
}

function renderWidth() {
  const width = typedWidth(), { opening } = trialOf(current), bad = Number.isNaN(width);
  $("width").setAttribute("aria-invalid", bad);
  $("widthnote").hidden = !bad && !(width > opening);
  $("widthnote").classList.toggle("bad", bad);
  $("widthnote").textContent = bad ? "This is not a width in mm. Correct or clear it; nothing is saved until then."
    : `The hand opens only ${opening} mm. Is ${width} mm right?`;
}

function requireWidth() {
  if (!Number.isNaN(typedWidth())) return true;
  renderWidth();
  $("width").focus();
  return false;
}

function fields(outcome) {
  const width = typedWidth();
  return {
    outcome,
    time: now(),
    operator: $("operator").value.trim(),
    note: $("note").value.trim(),
    width_mm: Number.isNaN(width) ? null : width,
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

function now() {  // local time with its zone
  const moment = new Date(), zone = -moment.getTimezoneOffset();
  const local = new Date(moment.getTime() + 60000 * zone).toISOString().slice(0, 19);
  const two = (value) => String(Math.floor(Math.abs(value))).padStart(2, "0");
  return `${local}${zone < 0 ? "-" : "+"}${two(zone / 60)}:${two(zone % 60)}`;
}
