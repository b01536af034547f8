// Runs before viser's page does: says what is missing where it cannot run, and what cannot be sent.
"use strict";
(() => {
  const LARGEST_UPLOAD = 0; // put in by html_page.py [bytes]

  const styled = (tag, style, text = "") => {
    const element = document.createElement(tag);
    element.style.cssText = `font-family: sans-serif; line-height: 1.5; color: #222; ${style}`;
    element.textContent = text;
    return element;
  };

  // The token is used up, and what an address says of other servers is not believed.
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
    document.write("<template>"); // in which viser's own scripts, later in this file, do not run
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
      const large = [...input.files].find((file) => file.size > LARGEST_UPLOAD);
      if (large === undefined) return;
      event.stopImmediatePropagation();
      input.value = "";
      const mib = (bytes) => `${(bytes / 2 ** 20).toFixed(1)} MiB`;
      complain(
        `${large.name} was not sent: it has ${mib(large.size)}, and ` +
          `${mib(LARGEST_UPLOAD)} are the most that this page takes.`,
      );
    },
    true,
  );

  // What is typed counts once Enter is pressed or the field is left: a key says so that nobody
  // presses, which the program knows as a command (shortcuts.py).
  const isTypedIn = (element) =>
    element instanceof HTMLInputElement &&
    ["text", "number"].includes(element.type) &&
    !element.hasAttribute("aria-haspopup");
  const TYPED = { key: "Enter", code: "Enter", altKey: true, shiftKey: true, bubbles: true };
  const SENT = 150; // viser sends what was typed within 50 ms
  let edited = null;
  let saying = 0;
  let byPointer = false;
  document.addEventListener(
    "input",
    (event) => {
      clearTimeout(saying); // typing in the next field says it, too
      edited = event.target;
    },
    true,
  );
  document.addEventListener("focusout", (event) => {
    if (event.target !== edited || !isTypedIn(edited)) return;
    edited = null;
    const say = () => document.documentElement.dispatchEvent(new KeyboardEvent("keydown", TYPED));
    saying = setTimeout(say, SENT);
  });
  document.addEventListener("pointerdown", () => (byPointer = true), true);
  document.addEventListener("keydown", () => (byPointer = false), true);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && isTypedIn(event.target)) event.target.blur();
  });

  // viser's page leaves keys to a box that was ticked, and to a list that was chosen from.
  document.addEventListener("click", (event) => {
    const isTicked = event.target instanceof HTMLInputElement && event.target.type === "checkbox";
    if (!byPointer || !(isTicked || event.target.closest?.("[role=option]"))) return;
    setTimeout(() => document.activeElement?.blur(), 0);
  });

  // Where the window is narrow, panels begin folded: the library, and on still narrower ones both.
  // On phones they are a sheet below the scene, which stays open.
  const FOLDED_AT = { left: 1100, right: 800 }; // width of the window [pixel]
  const PHONE = 576;
  const PANEL_POLL_INTERVAL = 200; // between checks for panels that are not there yet [ms]
  const isNarrow = (side) => PHONE < innerWidth && innerWidth < FOLDED_AT[side];
  const toFold = Object.keys(FOLDED_AT).filter(isNarrow);
  const fold = setInterval(() => {
    for (const side of [...toFold]) {
      const handle = document.querySelector(`[data-dock-region-collapse=${side}]`);
      if (handle === null) continue;
      if (handle.getAttribute("aria-expanded") === "true") {
        handle.click();
        setTimeout(() => document.activeElement?.blur(), 0); // nobody has gone there by keyboard
      }
      toFold.splice(toFold.indexOf(side), 1);
    }
    if (toFold.length === 0) clearInterval(fold);
  }, PANEL_POLL_INTERVAL);
})();
