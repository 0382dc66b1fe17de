// Draws the formulas of a documentation page: $`inline`$ and ```math blocks, as on the usual source hosts.
document.addEventListener("DOMContentLoaded", () => {
  const draw = (source, place, displayMode) => {
    const shown = document.createElement(displayMode ? "div" : "span");
    katex.render(source, shown, { displayMode, throwOnError: false });
    place.replaceWith(shown);
  };
  for (const code of document.querySelectorAll("code.language-math, pre.language-math > code")) {
    draw(code.textContent, code.closest(".example-wrap") ?? code.closest("pre") ?? code, true);
  }
  for (const code of document.querySelectorAll("code")) {
    const [before, after] = [code.previousSibling, code.nextSibling];
    if (before?.nodeType !== Node.TEXT_NODE || after?.nodeType !== Node.TEXT_NODE) continue;
    if (!before.data.endsWith("$") || !after.data.startsWith("$")) continue;
    before.data = before.data.slice(0, -1);
    after.data = after.data.slice(1);
    draw(code.textContent, code, false);
  }
});
