for (const table of document.querySelectorAll("table.sorts")) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  const text = (row, k) => (row.cells[k]?.innerText ?? "").trim().replaceAll("−", "-").replace(/^–$/, "");
  const number = (said) => parseFloat(said.replace(/^[<>±\s]+/, ""));
  if (body.rows.length < 3) continue;
  heads.forEach((head, k) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const way = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", way > 0 ? "ascending" : "descending");
      const rows = [...body.rows], said = rows.map((row) => text(row, k)).filter(Boolean);
      const numbers = said.every((one) => !isNaN(number(one)));
      const order = (a, b) => numbers ? number(a) - number(b) : a.localeCompare(b);
      rows.sort((one, two) => {
        const a = text(one, k), b = text(two, k);
        return a && b ? way * order(a, b) : !a - !b;
      });
      body.append(...rows);
    });
  });
}
