"use strict";

const $ = (id) => document.getElementById(id);
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const seen = () => document.hidden
  ? new Promise((done) => document.addEventListener("visibilitychange", done, { once: true }))
  : Promise.resolve();
let latest = null;  // the last status
let lastEvent = 0;
let online = true;

class Refusal extends Error {}  // an error message of the program in place of a status

// --- What comes from the program

async function showPictures() {
  let number = 0;
  for (;;) {
    await seen();
    try {
      const answer = await fetch(`frame.jpg?after=${number}`);
      if (answer.status === 200) {
        number = Number(answer.headers.get("X-Picture"));
        await show(await answer.blob());
      } else if (answer.status !== 204) {
        await sleep(1000);
      }
    } catch {
      number = 0;  // another session may answer next
      await sleep(1000);
    }
  }
}

async function show(blob) {
  const picture = $("picture"), before = picture.src;
  picture.src = URL.createObjectURL(blob);
  try { await picture.decode(); } catch { /* the next one will do */ }
  if (before.startsWith("blob:")) URL.revokeObjectURL(before);
}

async function showStatus() {
  for (;;) {
    await seen();
    try {
      const answer = await fetch(`status?after=${lastEvent}`);
      if (!answer.ok) throw new Refusal((await answer.json()).error);
      latest = await answer.json();
      online = true;
      render(latest);
    } catch (error) {
      const reason = error instanceof Refusal ? error.message : "";
      if (online) lastEvent = 0;
      online = false;
      say("bad", reason || "burg-drake does not answer; has it ended?");
      cover(reason || "burg-drake does not answer");
    }
    await sleep(online ? 250 : 1000);
  }
}

async function act(path, body = {}) {
  try {
    const answer = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    const data = await answer.json();
    if (data.error) addEvent({ text: data.error, bad: true });
  } catch {
    addEvent({ text: "burg-drake does not answer", bad: true });
  }
}

const change = (settings) => act("settings", settings);

// --- What the page shows

function render(status) {
  document.title = `${status.scene.name} · live view`;
  $("scene").textContent = status.scene.name;
  renderState(status);
  renderControls(status);
  renderObjects(status);
  if (status.picture) renderFigures(status);
  status.events.forEach(addEvent);
  lastEvent = status.events.reduce((most, event) => Math.max(most, event.number), lastEvent);
}

function renderState({ source, picture, settings, frames }) {
  cover(source.state === "lost" ? source.fault : "");
  if (source.state === "lost") say("bad", source.fault);
  else if (!picture) {
    if (source.state === "ended") say("bad", `${source.name} gave no usable picture`);
    else say("wait", `Waiting for the first picture of ${source.name}`);
  } else {
    const kind = !picture.valid ? "bad" : picture.doubt ? "doubt" : "good";
    say(kind, (picture.valid ? "" : "No pose: ") + picture.line);
  }
  const ended = source.state === "ended" && frames > 1;
  $("frozen").hidden = !settings.frozen && !ended;
  $("frozen").textContent = settings.frozen ? "frozen" : "last picture";
}

function say(kind, text) {
  const state = $("state");
  state.dataset.kind = kind;
  if (state.textContent !== text) state.textContent = text;
}

function cover(text) {
  $("cover").hidden = !text;
  $("cover").textContent = text;
}

function renderControls({ source, settings, recording, checking, picture }) {
  const still = source.state === "ended" && !recording;
  $("record").setAttribute("aria-pressed", Boolean(recording));
  $("record").lastElementChild.textContent = recording ? "Stop" : "Record";
  $("record").disabled = still;
  $("record").title = still ? "The source has ended; a snapshot (S) saves this picture"
    : "Record a video with poses (R)";
  $("recorded").hidden = !recording;
  if (recording) $("recorded").textContent = clock(recording.seconds);
  $("freeze").setAttribute("aria-pressed", settings.frozen);
  $("snapshot").disabled = !picture;
  $("check").disabled = checking || !(picture && picture.valid);
  $("check").lastElementChild.textContent = checking ? "Measuring …" : "Check placement";
  $("all").setAttribute("aria-pressed", !settings.guide);
  $("names").checked = settings.names;
  $("footprints").checked = settings.footprints;
  $("steady").checked = settings.steady;
  $("outlines").checked = settings.opacity === 0;
  if (document.activeElement !== $("opacity")) $("opacity").value = settings.opacity;
  $("opacity-value").textContent = `${Math.round(100 * settings.opacity)} %`;
}

const rows = new Map();

function renderObjects({ scene, settings, placement, tolerance }) {
  if (rows.size === 0) scene.objects.forEach((name) => rows.set(name, objectRow(name)));
  for (const [name, row] of rows) {
    row.classList.toggle("guided", settings.guide === name);
    row.classList.toggle("others", Boolean(settings.guide) && settings.guide !== name);
    row.querySelector("button").setAttribute("aria-pressed", settings.guide === name);
    const placed = placement && placement.objects[name];
    if (placed) fill(row, placed);
  }
  const limits = `${tolerance.mm.toFixed(1)} mm and ${tolerance.deg.toFixed(1)}°`;
  $("checked").textContent = !placement ? ""
    : placement.reason || `${placement.summary} by ${placement.method} at `
      + `${new Date(placement.taken).toLocaleTimeString()}. ✓ within ${limits}`;
}

function objectRow(name) {
  const row = document.createElement("tr");
  const cell = document.createElement("td"), button = document.createElement("button");
  button.textContent = name;
  button.title = `Show ${name} alone`;
  button.addEventListener("click", () => guide(latest.settings.guide === name ? "" : name));
  cell.append(button);
  row.append(cell, number(), number());
  $("objects").append(row);
  return row;
}

function number() {
  const cell = document.createElement("td");
  cell.className = "number";
  return cell;
}

function fill(row, placed) {
  const [, off, turn] = row.cells;
  const kind = placed.status === "measured" ? (placed.within ? "within" : "off") : "unsure";
  row.classList.toggle("doubtful", placed.status === "uncertain");
  let why = row.cells[0].querySelector("small");
  if (!why) row.cells[0].append(why = document.createElement("small"));
  why.textContent = placed.status === "uncertain" ? placed.reason : "";
  off.className = turn.className = `number ${kind}`;
  off.title = turn.title = placed.reason;
  if (placed.mm === null) {
    write(off, placed.status === "not_seen" ? "not seen" : "?");
    write(turn, "");
    return;
  }
  const mark = { within: "✓ ", off: "✗ ", unsure: "? " }[kind];
  write(off, mark + short(placed.mm), spread(placed.sd_mm));
  write(turn, placed.deg === null ? "–" : `${signed(placed.deg)}°`, spread(placed.sd_deg));
}

function write(cell, text, small = "") {
  cell.textContent = text;
  if (!small) return;
  const extra = document.createElement("small");
  extra.textContent = small;
  cell.append(extra);
}

const short = (x) => x.toFixed(Math.abs(x) < 9.995 ? 2 : 1);
const spread = (sd) => (sd === null ? "" : `± ${short(sd)}`);
const signed = (x) => (x < 0 ? "−" : "+") + short(Math.abs(x));
const clock = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, "0")}`;

function renderFigures({ picture, source }) {
  const stages = Object.entries(picture.milliseconds);
  const figures = [
    ["Source", picture.name || source.name],
    ["Markers", `${picture.markers} of ${picture.of_markers}`],
    ["Reprojection error", known(picture.reprojection_error, 2, "px")],
    ["Camera, x y z", picture.p_SC_mm ? `${picture.p_SC_mm.map((x) => x.toFixed(1)).join(" ")} mm` : "–"],
    ["Standard deviation", known(picture.position_sd_mm, 3, "mm")],
    ["Scale of the print", known(picture.scale && 100 * picture.scale, 2, "%")],
    ["Frames a second", known(picture.rate, 1, "")],
    ...stages.map(([name, ms]) => [`Time: ${name}`, known(ms, 1, "ms")]),
  ];
  $("figures").replaceChildren(...figures.flatMap(([name, value]) => {
    const term = document.createElement("dt"), data = document.createElement("dd");
    term.textContent = name;
    data.textContent = value;
    return [term, data];
  }));
}

const known = (x, digits, unit) => (x === null ? "–" : `${x.toFixed(digits)} ${unit}`);

function addEvent({ text, bad }) {
  const line = document.createElement("li");
  line.textContent = text;
  if (bad) line.className = "bad";
  $("events").prepend(line);
  while ($("events").children.length > 30) $("events").lastElementChild.remove();
}

// --- What the viewer does

function guide(name) { change({ guide: name }); }

function step(by) {
  if (!latest) return;
  const names = ["", ...latest.scene.objects];
  const at = names.indexOf(latest.settings.guide);
  latest.settings.guide = names[(at + by + names.length) % names.length];  // keys come in bursts
  guide(latest.settings.guide);
}

const actions = {
  snapshot: () => act("snapshot"),
  record: () => act("record", { on: !(latest && latest.recording) }),
  freeze: () => change({ frozen: !(latest && latest.settings.frozen) }),
  check: () => { if (!$("check").disabled) act("check"); },
  previous: () => step(-1),
  next: () => step(1),
  all: () => guide(""),
  full: () => (document.fullscreenElement ? document.exitFullscreen() : $("view").requestFullscreen()),
};
const keys = {
  s: "snapshot", r: "record", " ": "freeze", c: "check", f: "full",
  ArrowLeft: "previous", ArrowRight: "next", Escape: "all",
};

for (const id of ["snapshot", "record", "freeze", "check", "previous", "next", "all"]) {
  $(id).addEventListener("click", actions[id]);
}
$("view").addEventListener("dblclick", actions.full);
document.addEventListener("keydown", (event) => {
  const name = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  const own = (event.key.startsWith("Arrow") && event.target.type === "range")
    || (event.key === " " && event.target.closest("button, input, summary"));
  if (!name || own || event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
  event.preventDefault();
  actions[name]();
});
let before = 0.45;  // opacity to restore after outlines only
$("opacity").addEventListener("input", (event) => change({ opacity: Number(event.target.value) }));
for (const id of ["names", "footprints", "steady"]) {
  $(id).addEventListener("change", (event) => change({ [id]: event.target.checked }));
}
$("outlines").addEventListener("change", (event) => {
  if (event.target.checked && latest) before = latest.settings.opacity || before;
  change({ opacity: event.target.checked ? 0 : before });
});

showPictures();
showStatus();
