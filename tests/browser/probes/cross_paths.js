// What the page computes of cross paths: shortest ways over surfaces, and points along the arcs of ellipses.
async ({ ways, paths, beam }) => {
  const { ellipseArc, overCircle, overCorner, overSide } = await import("/page/cross_paths.js");
  const over = { circle: overCircle, corner: overCorner, side: overSide };
  const points = (arc) => {
    if (arc === null) return null;
    const [x, y, a, b, turn, from, to] = arc;
    return Array.from({ length: 9 }, (_, i) => {
      const at = from + ((to - from) * i) / 8, along = a * Math.cos(at), up = b * Math.sin(at);
      return [x + along * Math.cos(turn) - up * Math.sin(turn), y + along * Math.sin(turn) + up * Math.cos(turn)];
    });
  };
  return {
    ways: ways.map(([kind, transmitter, listener, ...surface]) => over[kind](transmitter, listener, ...surface)),
    arcs: paths.map((path) => points(ellipseArc(path, beam))),
  };
}
