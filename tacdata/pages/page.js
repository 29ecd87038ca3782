"use strict";
// Behaviour of every page: commands are copied, tables sorted and filtered, folded parts opened by a link and in print.
const tacdata = (() => {
  const make = (tag, text, attributes = {}) => {
    const node = document.createElement(tag);
    if (text !== null && text !== undefined) node.textContent = text;
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };
  async function copy(text) {
    try { await navigator.clipboard.writeText(text); return true; } catch { /* a page from a file may not */ }
    const field = make("textarea", text);
    document.body.append(field);
    field.select();
    const done = document.execCommand("copy");
    field.remove();
    return done;
  }
  function copyable(code) {
    const button = make("button", "copy", {type: "button", class: "copy", "aria-label": "copy " + code.textContent});
    button.onclick = async () => {
      button.textContent = await copy(code.textContent) ? "copied" : "select it by hand";
      setTimeout(() => { button.textContent = "copy"; }, 2000);
    };
    code.after(button);
  }
  const order = cell => {
    // A number in a cell sorts as a number, with an interval or unit behind it, too.
    if (cell.dataset.order) return Number(cell.dataset.order);
    const found = cell.textContent.replace("−", "-").replace(/(\d),(?=\d{3})/g, "$1").match(/^[<> ]*([-+]?\d*\.?\d+(e[-+]?\d+)?)/i);
    return found ? Number(found[1]) : cell.textContent.trim().toLowerCase();
  };
  function compare(a, b) {
    if (typeof a === typeof b) return a < b ? -1 : a > b ? 1 : 0;
    return typeof a === "number" ? -1 : 1;  // words and dashes last
  }
  function sortable(table) {
    const heads = [...table.querySelectorAll("thead th")], body = table.tBodies[0];
    if (!body || body.rows.length < 2) return;
    heads.forEach((head, k) => {
      const button = make("button", head.textContent, {type: "button", title: "sort"});
      head.replaceChildren(button);
      button.onclick = () => {
        const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
        heads.forEach(other => { other.removeAttribute("aria-sort"); other.firstChild.textContent = other.firstChild.textContent.replace(/ [▲▼]$/, ""); });
        head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
        button.textContent += sign > 0 ? " ▲" : " ▼";
        const rows = [...body.rows].map(row => [order(row.cells[k]), row]);
        rows.sort((a, b) => typeof a[0] === typeof b[0] ? sign * compare(a[0], b[0]) : compare(a[0], b[0]));
        body.append(...rows.map(entry => entry[1]));
      };
    });
  }
  let fields = 0;
  function filterable(holder) {
    const rows = [...holder.querySelectorAll("tbody tr")], id = `values-${++fields}`;
    const words = [...new Set(rows.flatMap(row => [...row.cells].filter(c => !c.classList.contains("number")).map(c => c.textContent.trim())))];
    const bar = make("div", null, {class: "filter"}), count = make("span", "", {role: "status"});
    const field = make("input", null, {type: "search", placeholder: "filter rows", "aria-label": "filter rows", list: id});
    const values = make("datalist", null, {id});
    values.append(...words.filter(Boolean).slice(0, 200).map(value => make("option", null, {value})));
    field.oninput = () => {
      const parts = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of rows) row.hidden = !parts.every(part => row.textContent.toLowerCase().includes(part));
      const left = rows.filter(row => !row.hidden).length;
      count.textContent = left ? (parts.length ? `${left} of ${rows.length} rows` : "") :
        `no row has it; there are: ${words.filter(Boolean).slice(0, 12).join(", ")}`;
    };
    bar.append(field, values, count);
    holder.prepend(bar);
  }
  function opened(target) {
    for (let node = target; node; node = node.parentElement) if (node.tagName === "DETAILS") node.open = true;
    const inside = target && target.querySelector(":scope > details");
    if (inside) inside.open = true;
  }
  document.querySelectorAll("code.command").forEach(copyable);
  document.querySelectorAll(".document table").forEach(sortable);
  document.querySelectorAll("[data-filtered]").forEach(filterable);
  const linked = () => { if (location.hash.length > 1) opened(document.getElementById(location.hash.slice(1))); };
  addEventListener("hashchange", linked);
  linked();
  addEventListener("beforeprint", () => document.querySelectorAll("main details").forEach(d => { d.open = true; }));
  const contents = document.querySelector("nav details");
  if (contents && innerWidth < 1200) contents.open = false;
  return {make, copy, copyable, compare};
})();
