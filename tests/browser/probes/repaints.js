// How often each plane is painted while nothing changes, and then while the front one does, ten times, twice each.
async () => {
  const { scene } = await import("/page/main.js");
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  for (let i = 0; i < 10; i++) await frame();
  const drawn = { back: 0, front: 0 };
  const paint = scene.paint.bind(scene);
  scene.paint = (name, f) => {
    drawn[name]++;
    paint(name, f);
  };
  for (let i = 0; i < 10; i++) await frame();
  const idle = { ...drawn };
  for (let i = 0; i < 10; i++) {
    scene.invalidate("front");
    scene.invalidate("front");
    await frame();
    await frame();
  }
  return [idle, drawn];
}
