const pane = document.getElementById("meshcat-pane");
const narrowestAspect = +document.currentScript.dataset.aspect;
function fit() {
  if (!pane.offsetWidth || !pane.offsetHeight) return;
  viewer.camera.zoom = Math.min(1, pane.offsetWidth / pane.offsetHeight / narrowestAspect);
  viewer.set_3d_pane_size();
}
new ResizeObserver(fit).observe(pane);
function show(path, visible) {
  viewer.set_property(path.split("/").filter(Boolean), "visible", visible);
}
for (const box of document.querySelectorAll("#burg label input")) {
  box.addEventListener("change", () => {
    for (const path of box.dataset.paths.split(" ").filter(Boolean)) show(path, box.checked);
  });
}
for (const bar of document.querySelectorAll("#burg .bar")) {
  const paths = bar.dataset.paths.split(" ");
  const [low, high] = bar.querySelectorAll(".limits input");
  for (const end of [low, high]) {
    end.addEventListener("input", () => {
      if (+low.value >= +high.value) end.value = end === low ? +high.value - 1 : +low.value + 1;
      paths.forEach((path, k) => show(path, k >= +low.value && k < +high.value));
    });
  }
}
