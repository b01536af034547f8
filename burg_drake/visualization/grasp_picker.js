const picker = JSON.parse(document.getElementById("picker").textContent);
const chooser = document.getElementById("grasps");
const steps = path => path.split("/").filter(Boolean);
function showGripper() {
  const grasp = picker.grasps[+chooser.value];
  show(picker.path, Boolean(grasp));
  if (!grasp) return;
  viewer.set_transform(steps(picker.path), grasp.H);
  for (const [path, slide] of picker.slides) {
    const [x, y, z] = slide.map(s => s * grasp.closed);
    viewer.set_transform(steps(path), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]);
  }
  viewer.set_dirty();
}
chooser.addEventListener("input", showGripper);
function strokes(grasp, place) {
  const matrix = new MeshCat.THREE.Matrix4().fromArray(grasp.G);
  const at = (x, z) => place(new MeshCat.THREE.Vector3(x, 0, z).applyMatrix4(matrix));
  const half = grasp.width / 2, palm = -picker.finger;
  const [a, b, c, d] = [at(half, 0), at(half, palm), at(-half, palm), at(-half, 0)];
  return [[a, b], [b, c], [c, d], [at(0, palm), at(0, palm - picker.stem)]];
}
function away([a, b], x, y) {
  const [u, v] = [b.x - a.x, b.y - a.y];
  const t = Math.max(0, Math.min(1, ((x - a.x) * u + (y - a.y) * v) / (u * u + v * v || 1)));
  return Math.hypot(a.x + t * u - x, a.y + t * v - y);
}
function nearestGrasp(x, y) {
  const root = viewer.scene_tree.find(["drake"]).object;
  root.updateWorldMatrix(true, false);
  viewer.camera.updateMatrixWorld();
  const place = point => {
    const seen = root.localToWorld(point).project(viewer.camera);
    return {x: (1 + seen.x) / 2 * pane.offsetWidth, y: (1 - seen.y) / 2 * pane.offsetHeight,
      depth: seen.z};
  };
  const visible = picker.groups.map(
    path => viewer.scene_tree.find(steps(path)).object.visible);
  let best = -1, rank = Infinity;
  picker.grasps.forEach((grasp, k) => {
    if (!visible[grasp.group]) return;
    const lines = strokes(grasp, place);
    const far = Math.min(...lines.map(line => away(line, x, y)));
    if (far > 8) return;
    const cost = far > 3 ? 10 + far : lines[1][0].depth;
    if (cost < rank) [best, rank] = [k, cost];
  });
  return best;
}
let pressed = [0, 0];
pane.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
pane.addEventListener("pointerup", event => {
  if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
  const edge = pane.getBoundingClientRect();
  const k = nearestGrasp(event.clientX - edge.left, event.clientY - edge.top);
  if (k < 0) return;
  chooser.value = k;
  chooser.selectedOptions[0].scrollIntoView({block: "nearest"});
  showGripper();
});
