"""What the page can do: sort, filter, turn, unfold. Without script all is there to be read but each object's own curves and ranks."""

SCRIPT = """
"use strict";
(() => {
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const at = (name) => document.getElementById(name);
  document.documentElement.classList.add("scripted");

  // Sorting: numbers by data-value, largest first at first; texts by the reader's alphabet; what is missing stays last.
  const sort = (head) => {
    const table = head.closest("table"), body = table.tBodies[0], column = Number(head.dataset.column);
    const keyed = [...body.rows].map((row) => {
      const cell = row.cells[column], number = cell.dataset.value;
      return { row, key: number === undefined ? cell.textContent.trim() : Number(number), none: cell.classList.contains("none") };
    });
    const numeric = keyed.some((item) => typeof item.key === "number");
    const was = head.getAttribute("aria-sort");
    const descending = was === null ? numeric : was === "ascending";
    const order = (a, b) => numeric ? a.key - b.key : a.key.localeCompare(b.key, undefined, { numeric: true });
    keyed.sort((a, b) => a.none - b.none || (a.none ? 0 : (descending ? -1 : 1) * order(a, b)));
    for (const other of all("th", table.tHead)) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", descending ? "descending" : "ascending");
    body.append(...keyed.map((item) => item.row));
  };
  for (const button of all("th button")) button.addEventListener("click", () => sort(button.closest("th")));

  // Turning: while pointed at, once pressed, or all that are in view.
  const turnAll = at("turn-all"), still = matchMedia("(prefers-reduced-motion: reduce)");
  const pointed = new Set(), seen = new Set();
  const show = (button) => {
    const image = button.firstElementChild;
    const turns = pointed.has(button) || button.getAttribute("aria-pressed") === "true" || (turnAll.checked && seen.has(button));
    const wanted = turns ? image.dataset.turn : image.dataset.still;
    if (image.getAttribute("src") !== wanted) image.setAttribute("src", wanted);
  };
  const watcher = new IntersectionObserver((changes) => {
    for (const change of changes) {
      if (change.isIntersecting) seen.add(change.target); else seen.delete(change.target);
      show(change.target);
    }
  });
  const buttons = all("button.picture");
  for (const button of buttons) {
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
      pointed.delete(button);
      show(button);
    });
    button.addEventListener("pointerenter", (event) => {
      if (event.pointerType !== "mouse" || still.matches) return;
      pointed.add(button);
      show(button);
    });
    button.addEventListener("pointerleave", () => { pointed.delete(button); show(button); });
  }
  if (turnAll) turnAll.addEventListener("change", () => {
    if (turnAll.checked) { for (const button of buttons) watcher.observe(button); return; }
    watcher.disconnect();
    seen.clear();
    buttons.forEach(show);
  });

  // Unfolding: what a card holds back is made when it is first opened.
  for (const details of all("#objects details")) details.addEventListener("toggle", () => {
    const held = details.querySelector("template");
    if (held) held.replaceWith(held.content);
  });

  // Filtering: cards that do not fit are taken out, which costs less than to hide them.
  const list = at("objects"), cards = [...list.children];
  const filter = () => {
    const words = at("find").value.toLowerCase().split(/\\s+/).filter(Boolean), variant = at("variant").value, state = at("state").value;
    const left = cards.filter(({ dataset: data }) => {
      const asked = (!variant || data.variant === variant) && (!state || data.state === state);
      return asked && words.every((word) => data.text.includes(word));
    });
    list.replaceChildren(...left);
    at("count").textContent = `${left.length} of ${cards.length} objects`;
  };
  for (const name of ["find", "variant", "state"]) if (at(name)) at(name).addEventListener("input", filter);
  const form = document.querySelector("form.filter");
  if (form) { form.addEventListener("submit", (event) => event.preventDefault()); filter(); }
})();
"""
