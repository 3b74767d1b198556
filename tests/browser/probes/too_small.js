// What is smaller than a fingertip may be (WCAG 2.2: 24 by 24).
() => [...document.querySelectorAll("button, select, [role=tab], input:not([type=checkbox])")]
  .filter((element) => element.checkVisibility())
  .map((element) => [element.id || element.textContent, element.getBoundingClientRect()])
  .filter(([, box]) => box.width < 24 || box.height < 24)
  .map(([name, box]) => [name, box.width, box.height])
