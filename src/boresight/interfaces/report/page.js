"use strict";
(() => {
  const byId = (name) => document.getElementById(name);
  const calm = { responsive: true, displaylogo: false, scrollZoom: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };

  // ---- tables: sorting needs nothing but the table ----
  const keyOf = (row, column) => {
    const cell = row.cells[column];
    return cell.dataset.key ?? cell.textContent;
  };
  const compare = (a, b) => {
    const [x, y] = [Number(a), Number(b)];
    if (a === "" || b === "") return (a === "") - (b === "");
    return Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b) : x - y;
  };
  for (const head of document.querySelectorAll("table.sortable th")) {
    head.querySelector("button").addEventListener("click", () => {
      const body = head.closest("table").tBodies[0];
      const up = head.getAttribute("aria-sort") === "descending";
      for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const column = head.cellIndex;
      const rows = [...body.rows].sort((a, b) =>
        (up ? 1 : -1) * compare(keyOf(a, column), keyOf(b, column)));
      body.append(...rows);
    });
  }

  // ---- charts ----
  const inflate = async (name) => {
    const octets = Uint8Array.from(atob(byId(name).textContent), (each) => each.charCodeAt(0));
    const stream = new Blob([octets]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).text();
  };
  const kinds = { f4: Float32Array, f8: Float64Array, u1: Uint8Array, i4: Int32Array };
  const unpack = (packed) => {
    const octets = Uint8Array.from(atob(packed.bdata), (each) => each.charCodeAt(0));
    return new kinds[packed.dtype](octets.buffer);
  };
  const paint = () => new Promise((done) => { setTimeout(done, 0); });
  const hasWebGl = () => Boolean(document.createElement("canvas").getContext("webgl"));

  const quantile = (values, share) => {
    const known = values.filter(Number.isFinite).sort();
    return known.length ? known[Math.floor(share * (known.length - 1))] : 0;
  };

  const drawOne = (series, columns, entry) => {
    const cut = (name) => columns[name].slice(entry.start, entry.start + entry.count);
    const time = cut("time"), used = cut("used"), dof = cut("dof");
    const rows = series.quantities.length + 1;
    const layout = { ...series.layout, annotations: [], shapes: [] };
    const data = [];
    const step = 1 / rows, gap = 0.045;
    const place = (row, title, extra) => {
      const mark = row ? String(row + 1) : "";
      const low = 1 - (row + 1) * step + (row < rows - 1 ? gap : 0);
      layout["yaxis" + mark] = { ...series.yaxis, domain: [low, 1 - row * step],
        title: { text: title }, ...extra };
      return "y" + mark;
    };
    const split = (values, wanted) => values.map((value, i) => (used[i] === wanted ? value : NaN));
    const marks = (y, values, name) => [1, 0].map((wanted) => ({ type: "scatter", mode: "markers",
      x: time, y: split(values, wanted), yaxis: y, name,
      marker: wanted ? { size: 3.5, color: "#0072B2" }
        : { size: 7, color: "#D55E00", symbol: "x-thin-open", line: { width: 1.6 } },
      hovertemplate: "%{x|%H:%M:%S}: %{y:.4g}<extra></extra>" }));
    series.quantities.forEach(([stem, title], row) => {
      const values = cut(stem), sd = cut(stem + "_sd");
      const known = [...sd.keys()].filter((i) => Number.isFinite(sd[i]));
      const reach = 1.1 * Math.max(quantile(values.map(Math.abs), 0.99), 3 * quantile(sd, 0.5));
      const y = place(row, title, { range: [-reach, reach] });
      for (const sign of [-2, 2]) {
        data.push({ type: "scatter", mode: "lines", x: known.map((i) => time[i]),
          y: known.map((i) => sign * sd[i]), yaxis: y, hoverinfo: "skip", line: { width: 0.8, color: "#9aa5b1" },
          ...(sign > 0 ? { fill: "tonexty", fillcolor: "rgba(91,102,117,0.16)" } : {}) });
      }
      data.push(...marks(y, values, title));
    });
    const y = place(rows - 1, "NIS", { type: "log", tickvals: [0.01, 0.1, 1, 10, 100, 1000] });
    data.push(...marks(y, cut("nis").map((each) => Math.max(each, 0.01)), "NIS"));
    data.push({ type: "scatter", mode: "lines", x: time, yaxis: y, hoverinfo: "skip",
      y: Array.from(dof, (each) => series.quantiles[each]),
      line: { width: 1.4, dash: "dot", color: "#1c2430", shape: "hv" } });
    layout.xaxis = { ...series.xaxis, anchor: y };
    return Plotly.react("target-chart", data, layout, calm);
  };

  const highlight = (charts, track) => {
    const x = [], y = [];
    for (const trace of charts["plan-chart"].data) {
      if (trace.type.startsWith("scatter") && trace.mode === "lines" && trace.meta === "track") {
        trace.unpacked ??= [trace.customdata, trace.x, trace.y].map(unpack);
        const [numbers, east, north] = trace.unpacked;
        numbers.forEach((each, i) => { if (each === track) { x.push(east[i]); y.push(north[i]); } });
      }
    }
    const last = charts["plan-chart"].data.length - 1;
    return Plotly.restyle("plan-chart", { x: [x], y: [y] }, [last]);
  };

  // Returns the function that shows a target, by its track number.
  const prepare = (charts, series) => {
    const columns = Object.fromEntries(
      Object.entries(series.columns).map(([name, packed]) => [name, unpack(packed)]));
    const chooser = byId("target");
    series.index.forEach((entry, rank) => {
      chooser.add(new Option(`${rank + 1}. ${entry.title} (track ${entry.track})`, entry.track));
    });
    return (track) => {
      const entry = series.index.find((each) => each.track === track);
      if (!entry) return;
      chooser.value = track;
      byId("target-words").textContent = entry.words;
      for (const row of document.querySelectorAll("tr[data-track]")) {
        row.toggleAttribute("data-chosen", Number(row.dataset.track) === track);
      }
      drawOne(series, columns, entry);
      highlight(charts, track);
    };
  };

  const listen = (show) => {
    const ask = (track) => { history.replaceState(null, "", `#track=${track}`); show(track); };
    byId("target").addEventListener("change", (event) => ask(Number(event.target.value)));
    document.querySelector("#target-table tbody")?.addEventListener("click", (event) => {
      ask(Number(event.target.closest("tr").dataset.track));
      byId("plan").scrollIntoView();
    });
    for (const name of ["plan-chart", "nis-targets"]) {
      byId(name)?.on("plotly_click", (event) => {
        const point = event.points.find((each) => each.data.meta === "track");
        if (point) ask(Number(point.customdata));
      });
    }
  };

  // A tracking page shows one target at a time; a calibration's has none to choose.
  const explore = (charts, series) => {
    const show = prepare(charts, series);
    listen(show);
    const asked = /^#track=(\d+)$/.exec(location.hash);
    const first = series.index.find((each) => each.count >= 60) ?? series.index[0];
    if (first) show(asked ? Number(asked[1]) : first.track);
    if (asked) byId("plan").scrollIntoView();
  };

  const start = async () => {
    byId("no-script").remove();
    const script = document.createElement("script");
    script.textContent = await inflate("library");
    document.head.append(script);
    const { charts, series } = JSON.parse(await inflate("drawing"));
    if (series && !hasWebGl()) {
      for (const trace of charts["plan-chart"].data) trace.type = "scatter";
    }
    const draw = (name) => Plotly.newPlot(name, charts[name].data, charts[name].layout,
      { ...calm, scrollZoom: name === "plan-chart" });
    for (const name of Object.keys(charts)) {
      const fold = byId(name).closest("details:not([open])");
      if (fold) {  // drawn when it is opened: before, it has no size
        fold.addEventListener("toggle", () => draw(name), { once: true });
        continue;
      }
      await draw(name);
      await paint();
    }
    if (series) explore(charts, series);
    document.documentElement.dataset.drawn = "true";
  };

  start().catch((error) => {
    const words = document.createElement("p");
    words.className = "broken";
    words.textContent = `The charts could not be drawn in this browser (${error.message}). ` +
      "The sentences and tables of this page are complete without them.";
    document.querySelector("main").prepend(words);
    document.documentElement.dataset.drawn = "false";
  });
})();
