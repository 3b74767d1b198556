// What the plots keep of frames: the fields of one, values at some paths, and two thousand seconds thinned out.
async () => {
  const { History, numericFields, valueAt } = await import("/page/history.js");
  const frame = {
    pose: [1, 2, 3], ranges: [1.5, null], link: null, paused: true, cycle: 7, areas: [[1, 2, 3, 4]],
    objects: [{ number: 7, probability: 0.5, covariance: [4, 5, 6] }], vectors: [["sum", 8, 9]],
  };
  const paths = ["pose.heading", "objects.7.covariance.xy", "vectors.sum.y", "paused", "ranges.1", "link.bad", "objects.8.x"];
  const history = new History();
  for (let i = 0; i < 40000; i++) history.add(i / 20, { i });
  const thinned = history.samples.map(({ t }) => t);
  history.add(1500.5, { i: -1 });
  history.add(1500.5, { i: -2 });
  return {
    fields: [...numericFields(frame)], values: paths.map((path) => valueAt(frame, path)),
    first: thinned[0], count: thinned.length, newest: thinned.slice(-100), around: history.series("i", 1500.2, 1501.2),
  };
}
