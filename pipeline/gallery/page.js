"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const PER_PAGE = 60;
const byId = (id) => document.getElementById(id);
let page = 0;

function element(name, text, className) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

function fill(id, values) {
  for (const value of ["all", ...values]) {
    const option = element("option", value);
    option.value = value === "all" ? "" : value;
    byId(id).append(option);
  }
}

const unique = (values) => [...new Set(values)].sort();
const flaws = (scans) => scans.flatMap((scan) => scan.flaws);
fill("split", unique(data.scans.map((scan) => scan.split)));
fill("part", unique(data.scans.map((scan) => scan.part)));
fill("kind", ["no flaw", ...unique(flaws(data.scans).map((flaw) => flaw.kind))]);
fill("detectable", ["yes", "no"]);

function chosen() {
  const [split, part, kind, detectable] = ["split", "part", "kind", "detectable"]
    .map((id) => byId(id).value);
  const pixels = Number(byId("pixels").value) || 0;
  return data.scans.filter((scan) => {
    if (split && scan.split !== split) return false;
    if (part && scan.part !== part) return false;
    if (kind === "no flaw") return scan.flaws.length === 0;
    if (!kind && !detectable && !pixels) return true;
    return scan.flaws.some((flaw) => (!kind || flaw.kind === kind) && flaw.pixels >= pixels &&
      (!detectable || flaw.detectable === (detectable === "yes")));
  });
}

function badge(kind) {
  const made = element("span", kind, "kind");
  made.style.background = data.colours[kind];
  return made;
}

function picture(scan) {
  const box = element("div", undefined, "picture");
  for (const name of ["relief", "labels"]) {
    if (!scan[name]) continue;
    const image = element("img", undefined, name);
    image.src = scan[name];
    image.alt = name === "relief" ? `local relief of ${scan.id}` : "";
    image.width = scan.width;
    image.height = scan.height;
    box.append(image);
  }
  return box;
}

function card(scan) {
  const made = element("figure");
  made.tabIndex = 0;
  const caption = element("figcaption");
  caption.append(element("div", scan.id));
  const line = element("div", undefined, "facts");
  for (const kind of unique(scan.flaws.map((flaw) => flaw.kind))) line.append(badge(kind));
  line.append(`${scan.split}, ${(100 * scan.valid).toFixed(1)} % valid`);
  caption.append(line);
  made.append(picture(scan), caption);
  made.addEventListener("click", () => detail(scan));
  made.addEventListener("keydown", (event) => { if (event.key === "Enter") detail(scan); });
  return made;
}

function row(cells, name) {
  const made = element("tr");
  for (const cell of cells) made.append(element(name, cell === null ? "" : String(cell)));
  return made;
}

function detail(scan) {
  const box = byId("detail");
  const close = element("button", "close");
  close.type = "button";
  close.addEventListener("click", () => box.close());
  const table = element("table");
  table.append(row(["flaw", "kind", "points", "above the noise", "depth, mm", "SNR", "deviation / noise"], "th"));
  for (const flaw of scan.flaws) {
    table.append(row([flaw.number, flaw.kind, flaw.pixels, flaw.visible, flaw.depth_mm, flaw.snr,
      flaw.deviation_over_noise], "td"));
  }
  const hint = element("p", "With a cut and the point cloud: ");
  hint.append(element("code", `flawforge preview ${data.folder} --scan ${scan.id}`));
  box.replaceChildren(close, element("h2", scan.id), picture(scan), table, hint);
  box.showModal();
}

function median(values) {
  const sorted = values.filter((value) => value !== null).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.floor((sorted.length - 1) / 2)] : null;
}

function statistics(scans) {
  const splits = unique(scans.map((scan) => scan.split));
  const table = byId("statistics");
  table.replaceChildren(row(["kind", ...splits, "detectable", "points: median", "most",
    "depth, mm: least", "median", "most"], "th"));
  for (const kind of unique(flaws(scans).map((flaw) => flaw.kind))) {
    const own = flaws(scans).filter((flaw) => flaw.kind === kind);
    const depths = own.map((flaw) => flaw.depth_mm).filter((depth) => depth !== null);
    const number = (value) => (Number.isFinite(value) ? Number(value.toPrecision(3)) : "");
    table.append(row([kind,
      ...splits.map((split) => flaws(scans.filter((scan) => scan.split === split))
        .filter((flaw) => flaw.kind === kind).length),
      own.filter((flaw) => flaw.detectable).length,
      median(own.map((flaw) => flaw.pixels)), Math.max(...own.map((flaw) => flaw.pixels)),
      number(Math.min(...depths)), number(median(depths) ?? NaN), number(Math.max(...depths))], "td"));
  }
}

function show() {
  const scans = chosen();
  const pages = Math.max(1, Math.ceil(scans.length / PER_PAGE));
  page = Math.min(Math.max(page, 0), pages - 1);
  byId("count").textContent = `${scans.length} of ${data.scans.length}`;
  byId("page").textContent = `page ${page + 1} of ${pages}`;
  byId("back").disabled = page === 0;
  byId("next").disabled = page === pages - 1;
  byId("grid").replaceChildren(...scans.slice(page * PER_PAGE, (page + 1) * PER_PAGE).map(card));
  statistics(scans);
}

byId("filters").addEventListener("input", () => {
  document.body.classList.toggle("plain", !byId("labels").checked);
  page = 0;
  show();
});
byId("filters").addEventListener("submit", (event) => event.preventDefault());
byId("back").addEventListener("click", () => { page -= 1; show(); });
byId("next").addEventListener("click", () => { page += 1; show(); });
show();
