"use strict";
// Tables: a heading sorts the rows by its column, again the other way round.
for (const table of document.querySelectorAll("table")) {
  table.querySelectorAll("th").forEach((heading, column) => {
    const button = document.createElement("button");
    button.textContent = heading.textContent;
    heading.replaceChildren(button);
    button.addEventListener("click", () => {
      const descends = heading.getAttribute("aria-sort") === "ascending";
      for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", descends ? "descending" : "ascending");
      const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent;
      const order = (a, b) => (column === 0 ? a.localeCompare(b, "en", { numeric: true }) : Number(a) - Number(b));
      const rows = [...table.tBodies[0].rows];
      rows.sort((a, b) => (descends ? -1 : 1) * order(key(a), key(b)));
      table.tBodies[0].append(...rows);
    });
  });
}
// Pictures: two of each view on top of each other, divided by a line that follows the pointer.
const figures = [...document.querySelectorAll("figure")];
const choice = document.querySelector(".choice");
if (choice) {
  document.body.classList.add("live");
  const labels = [...figures[0].querySelectorAll("img")].map((image) => image.alt);
  const sides = ["left", "right"].map((side, number) => {
    const select = document.createElement("select");
    labels.forEach((label, n) => select.append(new Option(label, n, n === number, n === number)));
    const label = document.createElement("label");
    label.append(`${side}: `, select);
    choice.append(label);
    select.addEventListener("change", show);
    return [side, select];
  });
  function show() {
    for (const figure of figures) {
      figure.querySelectorAll("img").forEach((image, n) => {
        for (const [side, select] of sides) image.classList.toggle(side, n === Number(select.value));
      });
    }
  }
  for (const figure of figures) {
    const stage = figure.querySelector(".stage");
    const slider = document.createElement("input");
    Object.assign(slider, { type: "range", min: 0, max: 100, step: 0.1, value: 50 });
    slider.setAttribute("aria-label", "share of the left picture");
    const divide = () => stage.style.setProperty("--at", `${slider.value}%`);
    slider.addEventListener("input", divide);
    const follow = (event) => {
      const bounds = stage.getBoundingClientRect();
      slider.value = (100 * (event.clientX - bounds.left)) / bounds.width;
      divide();
    };
    stage.addEventListener("pointerdown", (event) => {
      stage.setPointerCapture(event.pointerId);
      event.preventDefault();
      follow(event);
    });
    stage.addEventListener("pointermove", (event) => stage.hasPointerCapture(event.pointerId) && follow(event));
    figure.append(slider);
    divide();
  }
  show();
}
