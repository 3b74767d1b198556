// How many frames a second there are while the whole map, or in its place a hundred lines, is drawn anew in each.
async (mode) => {
  const { scene, view, run } = await import("/page/main.js");
  const id = "control-under-test";
  let control = document.getElementById(id);
  if (control === null) {
    control = Object.assign(document.createElement("canvas"), { id, width: view.width, height: view.height });
    Object.assign(control.style, { position: "fixed", left: 0, top: 0, zIndex: -1 });
    document.body.append(control);
  }
  const ctx = control.getContext("2d");
  const lines = (n) => {
    ctx.clearRect(0, 0, control.width, control.height);
    ctx.beginPath();
    for (let i = 0; i < 100; i++) {
      ctx.moveTo(i * 10, n % 7);
      ctx.lineTo(i * 9, control.height);
    }
    ctx.stroke();
  };
  const began = performance.now();
  let frames = 0;
  await new Promise((done) => {
    const frame = () => {
      if (performance.now() - began > 600) {
        done();
        return;
      }
      frames++;
      if (mode === "control") lines(frames);
      else {
        view.x += 0.001;
        run.segmentsVersion++;
        scene.invalidate("back", "front");
      }
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  });
  return frames / ((performance.now() - began) / 1000);
}
