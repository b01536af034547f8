"use strict";

const $ = (id) => document.getElementById(id);
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const seen = () => (document.hidden
  ? new Promise((done) => document.addEventListener("visibilitychange", done, { once: true }))
  : Promise.resolve());
const CLICK_GUARD_TIME = 600;  // ms after a trial is shown in which clicks on outcomes are ignored
const KEYS = [..."1234567890"];  // of the outcomes
const MAX_WIDTH = 10000;  // mm
const MAX_QUICK_CHECK_TIME = 5;  // s; slower checks are not repeated automatically

let plan = null;
let outbox = null;
const entries = new Map();   // entries stored by the program, by trial number
let version = "";
let online = false;
let problem = "";
let current = 0;
let shownSince = 0;
let view = "grasp";
let camera = null;
let asked = null;            // requested placement check, which waits for a picture
let refused = "";            // why the last placement check was not started
let history = [];            // entries of this page that can be undone, the last one at the end

// --- Beginning

async function begin() {
  window.history.replaceState(null, "", location.pathname);  // the token is used up
  while (!plan) {
    try {
      const answer = await fetch("plan");
      if (answer.ok) plan = await answer.json();
      else say("bad", (await answer.json()).error);
    } catch { say("bad", "burg-drake does not answer"); }
    if (!plan) await sleep(1000);
  }
  document.title = `${plan.file} · trials`;
  $("file").textContent = plan.file;
  $("operator").value = remembered("operator");
  outbox = new Outbox(plan.plan, onOutbox);
  buildOutcomes();
  buildList();
  if (plan.camera) {
    document.querySelector('[data-view="camera"]').hidden = false;
    $("placement").hidden = false;
    showFrames();
    showCamera();
  }
  follow();
}

function remembered(name) {
  try { return localStorage.getItem(`burg-drake ${name}`) || ""; } catch { return ""; }
}

function remember(name, value) {
  try { localStorage.setItem(`burg-drake ${name}`, value); } catch { /* for this time alone */ }
}

// --- What the program has

async function follow() {
  for (;;) {
    await seen();
    try {
      const answer = await fetch(`states?after=${version}`, { signal: AbortSignal.timeout(20000) });
      if (answer.status === 200) take(await answer.json());
      else if (answer.status !== 204) throw new Error((await answer.json()).error);
      if (!online) { online = true; render(); outbox.wake(); }
    } catch {
      online = false;
      version = "";
      renderSaved();
    }
    await sleep(1000);
  }
}

function take(states) {
  if (states.plan !== plan.plan) { location.reload(); return; }
  problem = states.problem;
  if (!problem) {
    version = states.version;
    states.entries.forEach((entry) => entries.set(entry.number, entry));
    if (!current) show(firstOpen(0));
  }
  render();
}

function onOutbox(item, entry) {
  if (entry) { entries.set(entry.number, entry); version = ""; }
  if (item && item.before) history.push({ number: item.entry.number, before: item.before });
  history = history.slice(-50);
  render();
}

// A trial with the latest entry, whether or not that is on the disk yet.
function entryOf(number) {
  const known = entries.get(number);
  const waiting = outbox.of(number).at(-1);
  if (!known || !waiting) return known;
  const { outcome, operator, note, width_mm, time } = waiting.entry;
  const label = outcome ? labelOf(outcome) : "";
  return { ...known, outcome, label, operator, note, width_mm, time, waiting: true };
}

function labelOf(value) {
  return [...plan.outcomes, ...plan.others].find((one) => one.value === value).label;
}

// --- Which trial is shown

const trialOf = (number) => plan.trials.find((trial) => trial.number === number);

function firstOpen(after) {
  const open = plan.trials.filter(({ number }) => !(entryOf(number) || {}).outcome);
  const found = open.find(({ number }) => number > after) || open[0];
  return found ? found.number : plan.trials.at(-1).number;
}

function show(number) {
  const before = current && trialOf(current), trial = trialOf(number);
  current = number;
  shownSince = performance.now();
  const entry = entryOf(number);
  $("note").value = entry.note;
  $("width").value = entry.width_mm ?? "";
  const block = plan.trials.filter((one) => one.block === trial.block);
  const untouched = block.every((one) => !(entryOf(one.number) || {}).outcome);
  const fresh = (!before || before.block !== trial.block) && untouched;
  $("fresh").hidden = !fresh;
  $("fresh").textContent = fresh ? `New scene: set up ${trial.scene} as the picture shows it.` : "";
  if (fresh || view !== "camera") view = fresh ? "above" : "grasp";
  refused = "";
  if (plan.camera) post("watch", { number });
  render();
  const next = plan.trials.find((one) => one.number > number);
  if (next) new Image().src = pictureOf(`grasp/${next.number}`);  // loads it into the cache
}

function step(by) {
  const place = plan.trials.findIndex((trial) => trial.number === current) + by;
  if (plan.trials[place]) show(plan.trials[place].number);
}

// --- What is shown

function buildOutcomes() {
  plan.outcomes.forEach(({ value, label, meaning }, index) => {
    const button = make("button", "", label), key = make("kbd", "", KEYS[index]);
    button.prepend(key);
    button.append(make("small", "", meaning));
    button.dataset.outcome = value;
    button.addEventListener("click", () => enter(value));
    $("outcomes").append(button);
  });
  for (const { value, label } of plan.others) {
    const option = make("option", "", label);
    option.value = value;
    $("others").append(option);
  }
  $("others").addEventListener("change", () => {
    const { value } = $("others");
    $("others").value = "";
    if (value) enter(value);
  });
}

function make(kind, className = "", text = "") {
  const element = document.createElement(kind);
  element.className = className;
  element.textContent = text;
  return element;
}

function render() {
  if (!plan || !outbox) return;
  renderSaved();
  renderTroubles();
  if (!current) return;
  renderTrial();
  renderEntry();
  renderList();
}

function renderSaved() {
  const waiting = outbox.items.length - outbox.troubled.length;
  const those = waiting === 1 ? "1 entry is" : `${waiting} entries are`;
  if (!outbox.stored) say("bad", "This browser stores nothing: do not close the page before all is saved");
  else if (!online) say("bad", `No connection${waiting ? `: ${those} kept here` : ""}`);
  else if (problem) say("bad", problem);
  else if (waiting && outbox.problem) say("bad", `Not saved yet: ${outbox.problem}`);
  else if (waiting) say("wait", "Saving …");
  else if (outbox.troubled.length) say("bad", "Not everything is saved");
  else if (camera && camera.measuring && camera.measuring.keep) {
    say("wait", `Measuring for trial ${camera.measuring.number} …`);
  }
  else say("good", "All saved");
}

function say(kind, text) {
  $("saved").dataset.kind = kind;
  if ($("saved").textContent !== text) $("saved").textContent = text;
}

const pictureOf = (name) => `picture/${name}.jpg?plan=${plan.plan}`;

function renderTrial() {
  const trial = trialOf(current);
  $("number").textContent = trial.number;
  const { instance, object } = trial;
  $("name").textContent = instance === object ? instance : `${instance} (${object})`;
  for (const tab of $("views").children) {
    tab.setAttribute("aria-selected", tab.dataset.view === view);
  }
  if (view !== "camera") {
    const name = view === "grasp" ? `grasp/${trial.number}` : `${view}/${trial.block}`;
    const address = pictureOf(name);
    if ($("picture").getAttribute("src") !== address) {
      $("picture").src = address;
      $("making").hidden = false;
      $("picture").style.visibility = "hidden";
    }
    $("picture").alt = view === "grasp"
      ? `the hand at the grasp of trial ${trial.number}, on ${instance}`
      : `${trial.scene}, ${view === "above" ? "from above" : "from the front"}`;
    $("line").hidden = true;
  }
  const rows = [
    ["approach", trial.approach],
    ["fingers", `${trial.fingers}; width ${trial.width.toFixed(0)} mm`],
    ["grasp at", trial.point],
    ...(trial.simulated ? [["simulated", trial.simulated.replaceAll("_", " ")]] : []),
  ];
  const key = JSON.stringify(rows);
  if ($("grasp").dataset.key === key) return;
  $("grasp").dataset.key = key;
  $("grasp").replaceChildren(...rows.flatMap(([name, text]) => [make("dt", "", name), make("dd", "", text)]));
}

function renderEntry() {
  renderWidth();
  const entry = entryOf(current);
  const done = Boolean(entry.outcome);
  const parts = [entry.label, entry.operator, clock(entry.time)].filter(Boolean);
  $("entered").textContent = done ? `Entered: ${parts.join(", ")}. Another button corrects it.`
    : "How did it end?";
  $("entered").classList.toggle("done", done);
  for (const button of $("outcomes").children) {
    button.setAttribute("aria-pressed", button.dataset.outcome === entry.outcome);
  }
  const changed = $("note").value.trim() !== entry.note
    || fields(null).width_mm !== (entry.width_mm ?? null);
  $("keep").hidden = !(done && changed);
  $("clear").hidden = !done;
  const last = history.at(-1);
  $("last").hidden = !last;
  if (last) {
    const after = entryOf(last.number);
    $("last").firstElementChild.textContent = `Trial ${last.number}: ${after.label || "entry deleted"}`;
  }
}

function clock(time) { return time ? time.slice(11, 16) : ""; }

// --- What the viewer does

$("picture").addEventListener("error", async () => {  // such as while there is no connection
  const address = $("picture").getAttribute("src");
  await sleep(2000);
  if (view !== "camera" && $("picture").getAttribute("src") === address) $("picture").src = address;
});
$("picture").addEventListener("load", () => {
  $("making").hidden = true;
  $("picture").style.visibility = "";
});
$("previous").addEventListener("click", () => step(-1));
$("next").addEventListener("click", () => step(1));
$("undo").addEventListener("click", undo);
$("keep").addEventListener("click", () => {
  if (!requireWidth()) return;
  const { outcome, time, operator } = entryOf(current);
  put(current, { ...fields(outcome), time, operator });
});
$("clear").addEventListener("click", () => put(current, { ...fields(null), note: "", width_mm: null }));
$("check").addEventListener("click", () => post("check", { number: current, keep: true }));
for (const id of ["note", "width"]) $(id).addEventListener("input", () => current && renderEntry());
$("operator").addEventListener("change", () => remember("operator", $("operator").value.trim()));
$("views").addEventListener("click", (event) => {
  const tab = event.target.closest("[data-view]");
  if (!tab) return;
  view = tab.dataset.view;
  render();
});
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || !current) return;
  if (event.target.closest("input, textarea, select")) {
    if (event.key === "Escape") event.target.blur();
    return;
  }
  const digit = plan.outcomes[KEYS.indexOf(event.key)];
  if (digit) enter(digit.value);
  else if (event.key === "ArrowLeft") step(-1);
  else if (event.key === "ArrowRight") step(1);
  else if (event.key === "u") undo();
  else if (event.key === "n") $("note").focus();
  else if (event.key === "c" && plan.camera) $("check").click();
  else return;
  event.preventDefault();
});

begin();
