// What has the focus, and whether one sees that.
() => {
  const element = document.activeElement, style = getComputedStyle(element);
  const shows = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2;
  return [element.id, element === document.body || shows];
}
