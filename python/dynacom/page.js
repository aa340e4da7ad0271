// SPDX-License-Identifier: BSD-2-Clause
// Draws the plots, and takes plots, top view and 3D scene through time together.
"use strict";

(async () => {
  const element = (id) => document.getElementById(id);

  // ---- What Python has packed ----

  async function unpack(id) {
    const text = atob(element(id).textContent);
    element(id).remove(); // there are megabytes of it
    const bytes = new Uint8Array(text.length);
    for (let index = 0; index < text.length; index++) bytes[index] = text.charCodeAt(index);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }
  const unpackText = async (id) => new TextDecoder().decode(await unpack(id));

  const data = JSON.parse(element("data").textContent);
  const numbers = await unpack("numbers");
  const count = numbers.byteLength / (8 + 4 * (data.columns.length - 1));
  const time = new Float64Array(numbers, 0, count);
  const columns = new Map();
  data.columns.slice(1).forEach((name, index) => {
    columns.set(name, new Float32Array(numbers, 8 * count + 4 * count * index, count));
  });
  const column = (name) => columns.get(name);

  const library = document.createElement("script");
  library.textContent = await unpackText("plotly");
  document.head.append(library);

  // ---- Plots ----

  // Plotly reads names as a sort of HTML.
  const escaped = (name) =>
    name.replace(/[&<>]/g, (character) => `&#${character.charCodeAt(0)};`);

  const FONT = { family: "system-ui, sans-serif", size: 12, color: "#5f6b76" };
  const LONGEST = 18; // letters of a name beside a plot
  const shortened = (name) =>
    escaped(name.length > LONGEST ? `${name.slice(0, LONGEST - 1)}…` : name);
  const rowNames = [...data.contacts.map(({ name }) => name), ...data.statuses];
  const LEFT = 18 + 6.5 * Math.min(Math.max(...rowNames.map((name) => name.length)), LONGEST);
  const AXIS = { zeroline: false, gridcolor: "#eceff2", linecolor: "#dfe3e7", automargin: false };
  // Above there is a legend, with about five names in a row; with four where a plot is narrow.
  const legendHeight = (names, inRow) => 12 + 20 * Math.ceil(names / inRow);
  const ABOVE = legendHeight(data.contacts.length + 1, 5);
  const MARGIN = { l: 0, r: 12, t: ABOVE, b: 28, autoexpand: false };
  const CONFIG = { displayModeBar: false, responsive: true, doubleClick: "reset" };
  const first = time[0];
  const last = time[count - 1];
  const all = last > first ? [first, last] : [first - 0.5, first + 0.5];
  const line = (name, values, color, more = {}) => ({
    x: time,
    y: values,
    name: shortened(name),
    mode: "lines",
    line: { color, width: 1.5, dash: more.dash },
    hovertemplate: "%{y:.3f}",
    ...more.trace,
  });

  // Along the axis of time: the windows without fault.
  const bands = data.windows.map(([x0, x1]) => ({
    type: "rect",
    yref: "paper",
    x0,
    x1,
    y0: 0,
    y1: 0.04,
    layer: "below",
    line: { width: 0 },
    fillcolor: "rgba(27, 127, 75, 0.45)",
  }));
  const overTime = (shapes, more = {}) => layout({ shapes: [...bands, ...shapes], ...more });

  function layout(more = {}) {
    return {
      font: FONT,
      margin: { ...MARGIN, l: LEFT, t: more.showlegend === false ? 8 : MARGIN.t },
      hovermode: "x unified",
      hoverlabel: { font: { size: 12 } },
      dragmode: "zoom",
      showlegend: true,
      legend: { orientation: "h", x: 1, xanchor: "right", y: 1, yanchor: "bottom" },
      xaxis: { ...AXIS, range: [...all], ticksuffix: " s", hoverformat: ".3f" },
      yaxis: { ...AXIS, fixedrange: true, rangemode: "tozero" },
      ...more,
    };
  }

  const level = (y, color) => ({
    type: "line",
    xref: "paper",
    x0: 0,
    x1: 1,
    y0: y,
    y1: y,
    layer: "below",
    line: { color, width: 1, dash: "dot" },
  });

  function drawForces() {
    const traces = [line("needed", column("needed"), "#9aa5af")];
    data.contacts.forEach(({ name, color, measured }, index) => {
      traces.push(line(name, column(`${index}.force`), color));
      if (measured) {
        const more = { dash: "dash", trace: { showlegend: false, opacity: 0.8 } };
        traces.push(line(`${name}, file`, column(`${index}.measured`), color, more));
      }
    });
    return [traces, overTime([level(1, "#9aa5af")])];
  }

  function drawFriction() {
    const traces = [];
    data.contacts.forEach(({ name, color }, index) => {
      const usage = column(`${index}.friction`);
      if (usage.some(Number.isFinite)) traces.push(line(name, usage, color));
      const yaw = column(`${index}.yaw`);
      if (yaw.some(Number.isFinite)) {
        const more = { dash: "dot", trace: { showlegend: false } };
        traces.push(line(`${name}, yaw`, yaw, color, more));
      }
    });
    return [traces, overTime([level(1, "#b3261e")])];
  }

  function drawFilled(name, title, color) {
    const limit = data.thresholds[name];
    const more = { trace: { fill: "tozeroy", fillcolor: `${color}1f` } };
    const shapes = limit === undefined ? [] : [level(limit, color)];
    const before = column(`${name}_before`); // repair
    if (before === undefined)
      return [[line(title, column(name), color, more)], overTime(shapes, { showlegend: false })];
    const { ghost: blue } = data.colors;
    const traces = [
      line("before", before, blue, { trace: { fill: "tozeroy", fillcolor: `${blue}1f` } }),
      line("after", column(name), color, more),
    ];
    return [traces, overTime(shapes)];
  }

  // The first and the last frame of each stretch in which something holds.
  function stretches(holds) {
    const found = [];
    for (let frame = 0; frame < count; frame++) {
      if (!holds(frame)) continue;
      const start = frame;
      while (frame + 1 < count && holds(frame + 1)) frame++;
      found.push([start, frame]);
    }
    return found;
  }

  const SURE = 0.9; // a contact is drawn faint where its confidence is less

  // Bars of one row: [[first, last frame], whether it is faint], ...
  function bars(found, { row, width, color, name }) {
    const half = count > 1 ? (last - first) / (count - 1) / 2 : 0.5;
    return {
      type: "bar",
      orientation: "h",
      base: found.map(([[start]]) => time[start] - half),
      x: found.map(([[start, end]]) => time[end] - time[start] + 2 * half),
      y: found.map(() => row),
      width,
      marker: { color, opacity: found.map(([, faint]) => (faint ? 0.4 : 1)) },
      customdata: found.map(([[start, end], faint]) => [
        time[start], time[end], escaped(name), faint ? ", unsure" : "",
      ]),
      hovertemplate:
        "%{customdata[2]}: %{customdata[0]:.3f} to %{customdata[1]:.3f} s%{customdata[3]}" +
        "<extra></extra>",
    };
  }

  function drawSchedule() {
    const status = column("status");
    const plain = (holds) => stretches(holds).map((stretch) => [stretch, false]);
    const parts = [];
    const rows = data.contacts.map(({ name, color, parts: own }, index) => {
      const active = column(`${index}.active`);
      const confidence = column(`${index}.confidence`);
      const sure = (frame) => confidence[frame] >= SURE;
      const found = [true, false].flatMap((wanted) =>
        stretches((frame) => active[frame] > 0 && sure(frame) === wanted)
          .map((stretch) => [stretch, !wanted]));
      // Of what carries, a thin line for each part below the contact's bar.
      own.forEach((part, number) => {
        const touches = column(`${index}.part${number}`);
        parts.push(bars(plain((frame) => touches[frame] > 0), {
          row: index + 0.14 + (0.3 * (number + 0.5)) / own.length,
          width: 0.2 / own.length,
          color,
          name: `${name}.${part}`,
        }));
      });
      return { name, color, found, width: own.length ? 0.36 : 0.6, up: own.length ? 0.1 : 0 };
    });
    const colors = new Map([["Solved", null], ["Relaxed", "#7a5195"], ["NoContact", "#b3261e"]]);
    data.statuses.forEach((name, code) => {
      const color = colors.has(name) ? colors.get(name) : "#5f6b76";
      const found = plain((frame) => status[frame] === code);
      if (color !== null) rows.push({ name, color, found, width: 0.6, up: 0 });
    });
    const traces = [
      ...parts,
      ...rows.map(({ found, up, ...how }, row) => bars(found, { ...how, row: row - up })),
    ];
    const yaxis = {
      ...AXIS,
      fixedrange: true,
      tickvals: rows.map((_, row) => row),
      ticktext: rows.map(({ name }) => shortened(name)),
      range: [rows.length - 0.5, -0.5],
    };
    element("schedule").style.height = `${44 + 28 * rows.length}px`;
    const more = { showlegend: false, hovermode: "closest", barmode: "overlay", yaxis };
    return [traces, overTime([], more)];
  }

  const CHANGES = [
    ["change_root", "root"],
    ["change_com", "CoM"],
    ["change_joints", "joint"],
  ].filter(([name]) => columns.has(name));
  const drawn = new Map([
    ...CHANGES.map(([name, title]) => [name, drawFilled(name, title, "#46505a")]),
    ["forces", drawForces()],
    ["friction", drawFriction()],
    ["residual_force", drawFilled("residual_force", "residual", "#b3261e")],
    ["residual_torque", drawFilled("residual_torque", "residual", "#b3261e")],
  ]);
  if (columns.has("distance"))
    drawn.set("distance", drawFilled("distance", "distance", data.colors.feasible_com));
  drawn.set("schedule", drawSchedule());
  const plots = [...drawn.keys()].map(element);
  const drawings = [...drawn.values()];

  // ---- From above ----

  const above = element("above");
  const POINTS = data.points;
  const FAINT_PATHS = Object.keys(POINTS).map((_, index) => data.contacts.length + index);
  const NOW = data.contacts.length + FAINT_PATHS.length; // the first of those that show one frame

  const isBefore = (name) => name.endsWith("_before"); // repair: its paths are dotted
  const dash = (name) => (isBefore(name) ? "dot" : undefined);
  const path = (name) => [column(`${name}_x`), column(`${name}_y`)];
  // The faint paths, which are drawn anew at every step: of some frames, where there are many.
  const FAINT = 5000;
  let faint = { from: 0, step: 1 };
  function faintPaths(from, to) {
    faint = { from, step: Math.ceil((to - from) / FAINT) };
    const thin = (list) => list.slice(from, to).filter((_, index) => index % faint.step === 0);
    const thinned = Object.keys(POINTS).map((name) => path(name).map(thin));
    return [0, 1].map((axis) => thinned.map((lists) => lists[axis]));
  }
  const corners = (index, frame) => {
    const found = [];
    for (let corner = 0; corner < data.contacts[index].corners; corner++)
      found.push([
        column(`${index}.corner${corner}_x`)[frame],
        column(`${index}.corner${corner}_y`)[frame],
      ]);
    return found;
  };
  const standing = (frame) =>
    data.contacts.map((_, index) => index).filter((index) => column(`${index}.active`)[frame] > 0);

  // Andrew's monotone chain, closed.
  function hull(points) {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    const chain = (list) => {
      const kept = [];
      for (const point of list) {
        while (kept.length > 1 && turn(kept.at(-2), kept.at(-1), point) <= 0) kept.pop();
        kept.push(point);
      }
      return kept.slice(0, -1);
    };
    const around = [...chain(sorted), ...chain(sorted.reverse())];
    return around.length > 0 ? [...around, around[0]] : sorted.slice(0, 1);
  }

  function drawAbove() {
    const traces = data.contacts.map(({ name, color, corners: sides }, index) => {
      // Where it stood: in the middle of every stretch in which it is active.
      const x = [];
      const y = [];
      for (const [start, end] of stretches((frame) => column(`${index}.active`)[frame] > 0)) {
        const around = corners(index, Math.round((start + end) / 2));
        for (const point of [...around, around[0]]) {
          x.push(point[0]);
          y.push(point[1]);
        }
        x.push(null);
        y.push(null);
      }
      return {
        x,
        y,
        name: escaped(name),
        mode: sides > 1 ? "lines" : "markers",
        line: { color, width: 1 },
        marker: { color, size: 7, symbol: "circle-open" },
        fill: sides > 1 ? "toself" : "none",
        fillcolor: `${color}14`,
        hoverinfo: "name",
        showlegend: false,
      };
    });
    const [xs, ys] = faintPaths(0, count);
    Object.entries(POINTS).forEach(([name, title], index) => {
      traces.push({
        x: xs[index],
        y: ys[index],
        name: title,
        mode: "lines",
        line: { color: data.colors[name], width: 1, dash: dash(name) },
        opacity: isBefore(name) ? 0.45 : 0.3,
        hovertemplate: "%{x:.3f}, %{y:.3f}",
        legendgroup: name,
        showlegend: false,
      });
    });
    const empty = { x: [], y: [], hoverinfo: "skip" };
    traces.push({
      ...empty,
      mode: "lines",
      line: { color: "#b59f00", width: 1.5 },
      fill: "toself",
      fillcolor: `${data.colors.support}66`,
      showlegend: false,
    });
    for (const [name, title] of Object.entries(POINTS)) {
      const color = data.colors[name];
      traces.push(
        {
          ...empty,
          mode: "lines",
          line: { color, width: 2, dash: dash(name) },
          legendgroup: name,
          showlegend: false,
        },
        {
          ...empty,
          name: title,
          mode: "markers",
          marker: { color, size: 11, line: { color: "#fff", width: 1.5 } },
          legendgroup: name,
        },
      );
    }
    return [
      traces,
      layout({
        hovermode: "closest",
        dragmode: "pan",
        margin: { ...MARGIN, l: 48, t: Math.max(ABOVE, legendHeight(Object.keys(POINTS).length, 4)) },
        xaxis: { ...AXIS, ...range(0), scaleanchor: "y" },
        yaxis: { ...AXIS, ...range(1) },
      }),
    ];
  }

  // What holds the soles and the CoM, and the other points where they are not far off.
  function range(axis) {
    let [low, high] = [Infinity, -Infinity];
    const extend = (value) => {
      if (!Number.isFinite(value)) return;
      low = Math.min(low, value);
      high = Math.max(high, value);
    };
    path("com")[axis].forEach(extend);
    for (let frame = 0; frame < count; frame++)
      for (const index of standing(frame))
        for (const point of corners(index, frame)) extend(point[axis]);
    const reach = 0.1 + 0.2 * (high - low);
    const [least, most] = [low - reach, high + reach];
    for (const name of Object.keys(POINTS))
      path(name)[axis].forEach((value) => extend(Math.min(Math.max(value, least), most)));
    const margin = 0.05 + 0.05 * (high - low);
    return { range: [low - margin, high + margin] };
  }

  function showAbove(frame) {
    const support = hull(standing(frame).flatMap((index) => corners(index, frame)));
    const x = [support.map((point) => point[0])];
    const y = [support.map((point) => point[1])];
    const [from, to] = [-0.5, 0.5].map((later) => nearest(time, time[frame] + later));
    for (const name of Object.keys(POINTS)) {
      const [xs, ys] = path(name);
      x.push(xs.slice(from, to + 1), [xs[frame]]);
      y.push(ys.slice(from, to + 1), [ys[frame]]);
    }
    return Plotly.restyle(above, { x, y }, x.map((_, index) => NOW + index));
  }

  await Promise.all([
    ...plots.map((plot, index) => Plotly.newPlot(plot, ...drawings[index], CONFIG)),
    Plotly.newPlot(above, ...drawAbove(), { ...CONFIG, scrollZoom: true }),
  ]);

  // ---- The scene ----

  // Frames are recorded twice, one after the other: with the ghost of the motion before repair, and
  // without it. There is no such box where there is no ghost.
  const ghost = element("ghost");
  if (ghost !== null) ghost.addEventListener("change", () => scene.show(now));

  // viser's page has no way to be told a time but its field for it: it is shown only here.
  const scene = {
    field: null,
    shown: -1, // its time
    times: data.sceneTimes,
    show(frame) {
      if (this.field === null) return;
      const times = ghost === null || ghost.checked ? this.times : data.sceneTimesWithoutGhost;
      const moment = times[nearest(this.times, time[frame] - first)];
      if (moment === this.shown) return;
      this.shown = moment;
      // A little later than the frame, and with more digits than the field shows: a text that it
      // has already would be no change.
      const text = (moment + 1e-4).toFixed(5);
      const { HTMLInputElement, Event } = this.field.ownerDocument.defaultView;
      const value = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
      value.set.call(this.field, text);
      this.field.dispatchEvent(new Event("input", { bubbles: true }));
    },
    async load() {
      if (this.times.length === 0) return;
      const frame = element("scene");
      frame.srcdoc = await unpackText("recording");
      await new Promise((resolve) => frame.addEventListener("load", resolve, { once: true }));
      const inside = frame.contentDocument;
      while (!(this.field = inside.querySelector("input.mantine-NumberInput-input")))
        await new Promise((resolve) => setTimeout(resolve, 100));
      // Its bar would be a second one.
      this.field.closest(".mantine-Paper-root").style.display = "none";
      inside.defaultView.addEventListener("keydown", onKey, { capture: true });
      this.show(now);
    },
  };

  // The index of the number that is the closest, in a list that ascends.
  function nearest(list, value) {
    let [low, high] = [0, list.length - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (list[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low > 0 && value - list[low - 1] < list[low] - value ? low - 1 : low;
  }

  // ---- One time for all ----

  let now = 0;
  let awaited = false;
  const cursors = plots.map((plot) => {
    const cursor = document.createElement("div");
    cursor.className = "cursor";
    plot.append(cursor);
    return cursor;
  });
  const slider = element("slider");
  slider.max = count - 1;

  function go(frame) {
    now = Math.max(0, Math.min(count - 1, frame));
    if (awaited) return;
    awaited = true;
    requestAnimationFrame(async () => {
      const shown = now;
      showCursors();
      slider.value = shown;
      const status = data.statuses[column("status")[shown]];
      element("clock").textContent = `${time[shown].toFixed(3)} s · frame ${shown} · ${status}`;
      scene.show(shown);
      await showAbove(shown);
      awaited = false;
      if (now !== shown) go(now);
    });
  }
  const goTo = (seconds) => go(nearest(time, seconds));

  function showCursors() {
    plots.forEach((plot, index) => {
      const { margin, xaxis } = plot.layout;
      const part = (time[now] - xaxis.range[0]) / (xaxis.range[1] - xaxis.range[0]);
      const { style } = cursors[index];
      style.left = `${margin.l + part * (plot.clientWidth - margin.l - margin.r) - 0.75}px`;
      style.top = `${margin.t}px`;
      style.bottom = `${margin.b}px`;
      style.display = part < 0 || part > 1 ? "none" : "";
    });
  }

  let zoomed = all;
  function zoom(range) {
    if (range[0] === zoomed[0] && range[1] === zoomed[1]) return;
    zoomed = range;
    for (const plot of plots) Plotly.relayout(plot, { "xaxis.range": [...range] });
    const [x, y] = faintPaths(nearest(time, range[0]), nearest(time, range[1]) + 1);
    Plotly.restyle(above, { x, y }, FAINT_PATHS);
    showCursors();
  }

  // frame: of what was pointed at, undefined where that is of no time.
  function follow(plot, frame) {
    const visit = ({ points: [point] }) => go(frame(point) ?? now);
    plot.on("plotly_hover", (event) => playing || visit(event));
    plot.on("plotly_click", (event) => {
      pause();
      visit(event);
    });
  }
  for (const plot of plots) {
    plot.on("plotly_relayout", () => zoom(plot.layout.xaxis.range));
    follow(plot, ({ data: trace, pointNumber, x }) =>
      nearest(time, trace.type === "bar" ? trace.customdata[pointNumber][0] : x),
    );
  }
  follow(above, ({ curveNumber, pointNumber }) =>
    curveNumber < data.contacts.length ? undefined : faint.from + faint.step * pointNumber,
  );
  window.addEventListener("resize", () => requestAnimationFrame(showCursors));

  // On paper, plots are as wide as that; the scene stays as it is, for it would be drawn too late.
  function fit(onPaper) {
    const frame = element("scene");
    frame.style.width = onPaper ? `${frame.clientWidth}px` : "";
    document.body.classList.toggle("paper", onPaper);
    for (const plot of [above, ...plots])
      Plotly.relayout(plot, onPaper ? { width: plot.clientWidth } : { width: null, autosize: true });
    showCursors();
  }
  window.addEventListener("beforeprint", () => fit(true));
  window.addEventListener("afterprint", () => fit(false));

  function visitTime(button) {
    pause();
    goTo(Number(button.dataset.time));
    document.querySelector(".pair").scrollIntoView({ block: "nearest", behavior: "smooth" });
  }
  document.querySelectorAll("button.time").forEach((button) => {
    // All of a reason's row leads to its time.
    const place = button.closest(".reasons tbody tr") ?? button;
    place.addEventListener("click", () => visitTime(button));
  });

  // ---- Playing ----

  let playing = false;
  let clock = 0;

  function play() {
    if (now === count - 1) go(0);
    playing = true;
    clock = time[now];
    let before = performance.now();
    const step = (instant) => {
      if (!playing) return;
      clock += (Math.max(instant - before, 0) / 1000) * Number(element("speed").value);
      before = instant;
      goTo(clock);
      if (clock >= last) pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
    showPlaying();
  }

  function pause() {
    playing = false;
    showPlaying();
  }

  function showPlaying() {
    element("play").textContent = playing ? "⏸" : "▶";
    element("play").ariaLabel = playing ? "Pause" : "Play";
  }

  const toggle = () => (playing ? pause() : play());

  function onKey(event) {
    const steps = { ArrowLeft: -1, ArrowRight: 1 };
    // Which mean something of their own to these.
    if (event.target.closest("select, input:not([type=range])")) return;
    if (event.code === "Space") {
      if (event.target.closest("button, summary")) return;
      toggle();
    } else if (event.code in steps) {
      pause();
      go(now + steps[event.code]);
    } else return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }
  window.addEventListener("keydown", onKey);
  element("play").addEventListener("click", toggle);
  slider.addEventListener("input", () => {
    pause();
    go(Number(slider.value));
  });

  go(0);
  await scene.load();
})();
