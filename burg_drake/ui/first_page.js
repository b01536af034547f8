// Runs before viser's page: reports missing browser features and files that are too large.
"use strict";
(() => {
  const MAX_UPLOAD_BYTES = 0; // replaced by admission.py

  const styled = (tag, style, text = "") => {
    const element = document.createElement(tag);
    element.style.cssText = `font-family: sans-serif; line-height: 1.5; color: #222; ${style}`;
    element.textContent = text;
    return element;
  };

  // Remove the used token, and parameters that would make viser connect to other servers.
  const query = new URLSearchParams(location.search);
  ["token", "websocket", "playbackPath"].forEach((name) => query.delete(name));
  history.replaceState(null, "", query.size ? `/?${query}` : "/");

  const missing = () => {
    if (typeof WebAssembly !== "object" || typeof DecompressionStream !== "function") {
      return [
        "This browser is too old for this page",
        "Use Chrome or Edge from 91, Firefox from 113 or Safari from 16.4.",
      ];
    }
    const context = document.createElement("canvas").getContext("webgl2");
    if (context === null) {
      return [
        "This browser shows no 3D: WebGL 2 is missing",
        "Switch on hardware acceleration in the browser's settings and restart it, or use another" +
          " browser. On a machine without a graphics card, Chrome renders in software if it is" +
          " started with --enable-unsafe-swiftshader. Nothing is lost: the scene is with the" +
          " program, and this page shows it when it is opened again.",
      ];
    }
    context.getExtension("WEBGL_lose_context")?.loseContext();
    return null;
  };

  const lines = missing();
  if (lines !== null) {
    const box = styled("main", "max-width: 40em; margin: 15vh auto; padding: 0 2em");
    box.setAttribute("role", "alert");
    box.append(styled("h1", "font-size: 1.4em", lines[0]), styled("p", "", lines[1]));
    document.addEventListener("DOMContentLoaded", () => document.body.append(box));
    document.write("<template>"); // keeps viser's scripts, later in this file, from running
    return;
  }

  const complain = (text) => {
    const box = styled(
      "div",
      "position: fixed; z-index: 100000; top: 1em; left: 50%; transform: translateX(-50%);" +
        " max-width: 40em; padding: 0.8em 1.2em; background: #fff; border-left: 6px solid #c92a2a;" +
        " box-shadow: 0 2px 12px #0005",
      text,
    );
    box.setAttribute("role", "alert");
    const close = styled("button", "margin-left: 1em; cursor: pointer", "Close");
    close.addEventListener("click", () => box.remove());
    box.append(close);
    document.body.append(box);
  };

  document.addEventListener(
    "change",
    (event) => {
      const input = event.target;
      if (!(input instanceof HTMLInputElement) || input.type !== "file") return;
      const large = [...input.files].find((file) => file.size > MAX_UPLOAD_BYTES);
      if (large === undefined) return;
      event.stopImmediatePropagation();
      input.value = "";
      const mib = (bytes) => `${(bytes / 2 ** 20).toFixed(1)} MiB`;
      complain(
        `${large.name} was not sent: it has ${mib(large.size)}, and ` +
          `${mib(MAX_UPLOAD_BYTES)} are the most that this page takes.`,
      );
    },
    true,
  );

  // A typed value is applied after Enter or when the field loses focus: the page then sends a
  // shortcut that nobody presses (shortcuts.py).
  const isTypedIn = (element) =>
    element instanceof HTMLInputElement &&
    ["text", "number"].includes(element.type) &&
    !element.hasAttribute("aria-haspopup");
  const TYPED = { key: "Enter", code: "Enter", altKey: true, shiftKey: true, bubbles: true };
  const SEND_DELAY = 150; // ms; viser sends typed values within 50 ms
  let edited = null;
  let saying = 0;
  let byPointer = false;
  document.addEventListener(
    "input",
    (event) => {
      clearTimeout(saying); // typing in the next field has the same effect
      edited = event.target;
    },
    true,
  );
  document.addEventListener("focusout", (event) => {
    if (event.target !== edited || !isTypedIn(edited)) return;
    edited = null;
    const say = () => document.documentElement.dispatchEvent(new KeyboardEvent("keydown", TYPED));
    saying = setTimeout(say, SEND_DELAY);
  });
  document.addEventListener("pointerdown", () => (byPointer = true), true);
  document.addEventListener("keydown", () => (byPointer = false), true);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && isTypedIn(event.target)) event.target.blur();
  });

  // After a click, a checkbox or a drop-down list keeps the focus, and viser ignores shortcuts.
  document.addEventListener("click", (event) => {
    const isTicked = event.target instanceof HTMLInputElement && event.target.type === "checkbox";
    if (!byPointer || !(isTicked || event.target.closest?.("[role=option]"))) return;
    setTimeout(() => document.activeElement?.blur(), 0);
  });

  // In a narrow window the library panel starts folded, in a narrower one both panels.
  // On phones they are a sheet below the scene, which stays open.
  const FOLD_WIDTHS = { left: 1100, right: 800 }; // width of the window [pixel]
  const PHONE_WIDTH = 576;
  const PANEL_POLL_INTERVAL = 200; // ms between checks for panels that are not loaded yet
  const isNarrow = (side) => PHONE_WIDTH < innerWidth && innerWidth < FOLD_WIDTHS[side];
  const toFold = Object.keys(FOLD_WIDTHS).filter(isNarrow);
  const fold = setInterval(() => {
    for (const side of [...toFold]) {
      const handle = document.querySelector(`[data-dock-region-collapse=${side}]`);
      if (handle === null) continue;
      if (handle.getAttribute("aria-expanded") === "true") {
        handle.click();
        setTimeout(() => document.activeElement?.blur(), 0); // the click has moved the focus
      }
      toFold.splice(toFold.indexOf(side), 1);
    }
    if (toFold.length === 0) clearInterval(fold);
  }, PANEL_POLL_INTERVAL);
})();
