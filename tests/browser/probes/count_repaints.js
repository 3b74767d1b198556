// Counts from now on how often each plane of the map is painted, in `window.painted`.
async () => {
  const { scene } = await import("/page/main.js");
  const paint = scene.paint.bind(scene);
  window.painted = { back: 0, front: 0 };
  scene.paint = (name, f) => {
    window.painted[name]++;
    paint(name, f);
  };
}
