"use strict";

// The live picture, and the placement errors of the objects.

async function showFrames() {
  let number = 0, epoch = 0;
  for (;;) {
    await seen();
    if (view !== "camera" || (camera && camera.checking)) { await sleep(200); continue; }
    try {
      const answer = await fetch(`frame.jpg?epoch=${epoch}&after=${number}`);
      if (answer.status === 200) {
        number = Number(answer.headers.get("X-Picture"));
        epoch = Number(answer.headers.get("X-Epoch"));
        await paint(await answer.blob());
      } else if (answer.status !== 204) await sleep(1000);
    } catch {
      number = epoch = 0;
      await sleep(1000);
    }
  }
}

async function paint(blob) {
  if (view !== "camera") return;
  const picture = $("picture"), before = picture.src;
  picture.src = URL.createObjectURL(blob);
  picture.alt = "camera with the scene drawn over it";
  try { await picture.decode(); } catch { /* the next one will do */ }
  if (before.startsWith("blob:")) URL.revokeObjectURL(before);
}

async function showCamera() {
  for (;;) {
    await seen();
    try {
      const answer = await fetch("camera");
      if (answer.ok) {
        camera = await answer.json();
        if (asked) Object.assign(camera, { checking: true, measuring: asked });
        renderCamera();
      }
    } catch { /* the other loop tells */ }
    await sleep(view === "camera" || (camera && camera.checking) ? 400 : 1500);
  }
}

function renderCamera() {
  if (!camera) return;
  renderSaved();
  const { check, checking, measuring } = camera;
  if (view === "camera") {
    $("line").hidden = false;
    const drawn = camera.drawn && camera.drawn !== current ? `; offsets shown are those of trial ${camera.drawn}` : "";
    $("line").textContent = (camera.fault || camera.line) + drawn;
  }
  $("check").disabled = checking || !camera.scene;
  $("check").textContent = !checking ? "Check placement"
    : measuring && measuring.number !== current ? `Measuring for trial ${measuring.number} …` : "Measuring …";
  const mine = check && check.number === current;
  $("checked").textContent = refused || (!mine ? [otherText(check), keptText()].filter(Boolean).join(" ") : check.problem || (check.kept ? "Saved with this trial." : "Not saved; press “Check placement” to save it."));
  const rows = mine ? Object.entries(check.objects) : Object.entries((entries.get(current) || {}).placement || {});
  $("objects").replaceChildren(...rows.flatMap(([name, placed]) => placeRow(name, placed)));
  const slow = check && check.seconds > MAX_QUICK_CHECK_TIME;
  if ($("always").checked && !checking && !slow && camera.valid && view === "camera") {
    post("check", { number: current, keep: false });
  }
}

// For a check that was started while another trial was shown.
function otherText(check) {
  if (!check) return "";
  if (check.kept) return `Measurement saved with trial ${check.number}.`;
  const { problem, number } = check;
  return !problem || problem.includes(`trial ${number} `) ? problem : `Trial ${number}: ${problem}.`;
}

function keptText() {
  const entry = entries.get(current);
  return entry && entry.photo ? `Saved with this trial: ${entry.photo}` : "";
}

function placeRow(name, { status, within, mm, deg, reason }) {
  const row = make("tr"), text = status === "not_seen" || mm === null ? "not seen" : `${mm.toFixed(1)} mm`;
  const kind = status !== "measured" ? "unsure" : within === undefined ? "" : within ? "within" : "off";
  const mark = { within: "✓ ", off: "✗ ", unsure: "? " }[kind] || "";
  row.append(make("th", "", name), make("td", kind, mark + text));
  row.append(make("td", kind, deg === null ? "" : `${(Math.round(10 * deg) / 10 || 0).toFixed(1)}°`));
  if (!reason) return [row];
  row.title = reason;
  const why = make("tr", "why"), cell = make("td", kind, reason);
  cell.colSpan = 3;
  why.append(cell);
  return [row, why];
}

async function post(path, body) {
  if (path === "check" && camera) {
    asked = body;
    Object.assign(camera, { checking: true, measuring: body });
    renderCamera();
  }
  try {
    const answer = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    const data = await answer.json();
    if (path === "check") {
      refused = data.error || "";
      if (refused && camera) camera.checking = false;
      renderCamera();
    }
  } catch { /* the status tells */ }
  if (path === "check") asked = null;
}
