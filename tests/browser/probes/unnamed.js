// What can be used and has no name that could be read out.
() => {
  const usable = "button, input, select, textarea, a[href], [role=tab], [role=application], [role=radio]";
  const named = (element) => element.getAttribute("aria-label") || element.textContent.trim() || element.labels?.length
    || element.getAttribute("aria-labelledby");
  return [...document.querySelectorAll(usable)]
    .filter((element) => element.checkVisibility() && !named(element)).map((element) => element.outerHTML);
}
