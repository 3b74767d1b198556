// By how many pixels anything is wider than where it stands.
() => {
  const over = (element) => element.scrollWidth - element.clientWidth;
  return {
    page: over(document.documentElement),
    panel: [...document.querySelectorAll(".panel")].filter((element) => element.checkVisibility()).map(over),
    tabs: over(document.getElementById("tabs")),
  };
}
