"use strict";
// Draws the figures from the data in the page. State is the set of hidden engines and the chosen time; both
// stand in the address after the #, so that a view can be passed on: #hide=exudyn,mujoco-native&t=5
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const SVG = "http://www.w3.org/2000/svg";
  const hidden = new Set();
  let now = data.duration;
  const painters = [];

  const make = (tag, attributes = {}, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  };
  const draw = (tag, attributes) => {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };
  const ink = (engine) => `var(--engine-${engine})`;
  const swatches = [...document.querySelectorAll(".legend .swatch")];
  const dashes = swatches.map((swatch) => swatch.querySelector("line").getAttribute("stroke-dasharray"));
  const isReference = (engine) => data.engines[engine] === "reference";
  const stop = (engine) => data.stops[engine];

  // Where curves lie on one another the reference shows as a band under them, and the others take turns: each is drawn
  // in dashes that leave room for the rest of its group.
  const TURN = 9;
  function line(engine, d, groups) {
    const others = (groups.find((group) => group.includes(engine)) || []).filter((other) => !isReference(other));
    const style = { d, stroke: ink(engine), "stroke-width": isReference(engine) ? 3.6 : 1.6, "stroke-dasharray": dashes[engine] };
    if (!isReference(engine) && others.length > 1) {
      style["stroke-dasharray"] = `${TURN} ${TURN * (others.length - 1)}`;
      style["stroke-dashoffset"] = -TURN * others.indexOf(engine);
    }
    return draw("path", style);
  }

  // The value at a time by straight lines between the samples; null in a gap and beyond the ends.
  function valueAt(t, times, values) {
    let low = 0, high = times.length - 1;
    if (t < times[0] || t > times[high]) return null;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    if (values[low] === null || values[high] === null) return null;
    const length = times[high] - times[low];
    return length ? values[low] + ((values[high] - values[low]) * (t - times[low])) / length : values[low];
  }

  // Whether every sample of a curve lies on another one, but for a distance that no reader sees.
  const PROBES = 200;
  function follows(curve, other, parts, near) {
    const every = Math.max(1, Math.floor(curve.t.length / PROBES));
    for (let k = 0; k < curve.t.length; k += every) {
      for (const part of parts) {
        const value = curve[part][k];
        const there = valueAt(curve.t[k], other.t, other[part]);
        if ((value === null) !== (there === null) || Math.abs(value - there) > near) return false;
      }
    }
    return true;
  }

  // Groups of engines whose curves lie on one another; what fell or ended early is in none.
  function findGroups(curves, parts, near) {
    const groups = [];
    for (const [key, curve] of Object.entries(curves)) {
      const engine = Number(key);
      if (hidden.has(engine) || stop(engine) || !curve.t.length) continue;
      const group = groups.find(([first]) => follows(curve, curves[first], parts, near) && follows(curves[first], curve, parts, near));
      if (group) group.push(engine); else groups.push([engine]);
    }
    return groups.filter((group) => group.length > 1);
  }

  const describeGroups = (groups) =>
    groups.map((group) => `On one another: ${group.map((engine) => data.engines[engine]).join(", ")}.`).join(" ");
  const minus = (text) => text.replace("-", "\u2212");

  // The index of the sample nearest to a time; times rise, and a null value is a gap.
  function nearest(curve, t) {
    let low = 0, high = curve.t.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (curve.t[middle] < t) low = middle; else high = middle;
    }
    return t - curve.t[low] < curve.t[high] - t ? low : high;
  }

  function steps(low, high, most) {
    const rough = (high - low) / most;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough * (1 - 1e-9));
    const marks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) marks.push(k * step);
    return { step, marks };
  }
  const decimals = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));

  // The axis follows the engines that stay up, and the others only where they are alone.
  function range(panel) {
    let low = Infinity, high = -Infinity;
    const seen = Object.keys(panel.curves).map(Number).filter((engine) => !hidden.has(engine));
    const upright = seen.filter((engine) => !stop(engine));
    for (const engine of upright.length ? upright : seen) {
      const curve = panel.curves[engine];
      for (const value of curve.v) {
        if (value === null) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (low > high) return [0, 1];
    if (panel.log) return [Math.floor(low), Math.max(Math.ceil(high), Math.floor(low) + 1)];
    const middle = (low + high) / 2;
    const half = Math.max(high - low, panel.span, 1e-9 * Math.abs(middle), 1e-300) * 0.54;
    return [middle - half, middle + half];
  }

  function ticks(panel, low, high) {
    if (panel.log) {
      const every = Math.ceil((high - low) / 6);
      const marks = [];
      for (let k = Math.ceil(low / every) * every; k <= high; k += every) marks.push([k, ["10", make("sup", {}, minus(String(k)))]]);
      return marks;
    }
    const { step, marks } = steps(low, high, 5);
    return marks.map((value) => [value, [minus(value.toFixed(decimals(step)))]]);
  }

  const digits = (value, count) => {
    const plain = value === 0 || (Math.abs(value) >= 1e-3 && Math.abs(value) < 1e6);
    return (plain ? value.toPrecision(count) : value.toExponential(count - 1)).replaceAll("-", "\u2212");
  };
  const shown = (panel, value) => (panel.log ? digits(10 ** value, 3) : digits(value, 6));

  function panelPainter(figure, panel) {
    const plot = figure.querySelector(".plot");
    const readout = figure.querySelector(".readout");
    const end = data.duration || 1;
    let low = 0, high = 1;
    const px = (t) => (100 * t) / end;
    const py = (v) => 100 - (100 * (v - low)) / (high - low);
    const path = (curve) => {
      let d = "", pen = "M";
      curve.v.forEach((value, k) => {
        if (value === null) { pen = "M"; return; }
        d += `${pen}${px(curve.t[k]).toFixed(3)} ${py(value).toFixed(3)}`;
        pen = "L";
      });
      return d;
    };
    const cursor = draw("path", { class: "cursor" });
    let groups = [];

    function paint() {
      [low, high] = range(panel);
      groups = findGroups(panel.curves, ["v"], 0.01 * (high - low));
      figure.querySelector(".together").textContent = describeGroups(groups);
      const svg = draw("svg", { viewBox: "0 0 100 100", preserveAspectRatio: "none" });
      const labels = [];
      for (const [value, text] of ticks(panel, low, high)) {
        svg.append(draw("path", { class: "gridline", d: `M0 ${py(value)}H100` }));
        labels.push(make("span", { class: "tick y", style: `top:${py(value)}%` }, ...text));
      }
      const { step, marks } = steps(0, end, 6);
      for (const t of marks) labels.push(make("span", { class: "tick x", style: `left:${px(t)}%` }, t.toFixed(decimals(step))));
      labels.push(make("span", { class: "tick name" }, "time [s]"));
      for (const [engine, curve] of Object.entries(panel.curves)) {
        if (hidden.has(Number(engine))) continue;
        svg.append(line(Number(engine), path(curve), groups));
        const last = curve.t.length - 1;
        if (!stop(engine) || curve.v[last] === null) continue;
        const top = Math.min(100, Math.max(0, py(curve.v[last])));
        labels.push(make("span", { class: "stop", style: `left:${px(curve.t[last])}%;top:${top}%;color:${ink(engine)}`, title: `${data.engines[engine]} ${stop(engine)}` }, "\u2715"));
      }
      for (const mark of panel.marks) {
        if (hidden.has(mark.engine) || mark.t > end) continue;
        svg.append(draw("path", { d: `M${px(mark.t)} 0V100`, stroke: ink(mark.engine), "stroke-width": 1.5, "stroke-dasharray": "1 4" }));
      }
      svg.append(cursor);
      plot.replaceChildren(svg, make("div", { class: "frame" }), ...labels);
      point();
    }

    // What an engine has at the chosen time: a place on its curve, or the reason why there is none.
    function read(engine) {
      const curve = panel.curves[engine];
      if (!curve) return { reason: panel.absent[engine] };
      const k = nearest(curve, now);
      const over = now > curve.t[curve.t.length - 1] + 1e-9;
      if (over && stop(engine)) return { reason: `\u2715 ${stop(engine)}` };
      if (over || curve.v[k] === null) return { reason: panel.log ? "too small to draw" : "no value" };
      return { t: curve.t[k], value: curve.v[k] };
    }

    function point() {
      cursor.setAttribute("d", `M${px(now)} 0V100`);
      plot.querySelectorAll(".dot").forEach((dot) => dot.remove());
      const items = [];
      const listed = new Set();
      data.engines.forEach((_, engine) => {
        if (hidden.has(engine) || listed.has(engine)) return;
        const group = groups.find((each) => each.includes(engine)) || [engine];
        group.forEach((each) => listed.add(each));
        const found = group.map(read);
        const texts = [...new Set(found.map((one) => one.reason || shown(panel, one.value)))];
        const names = group.flatMap((each, k) => [k ? " = " : "", make("span", { class: "whole" }, data.engines[each])]);
        items.push(make("li", {}, ...group.map((each) => swatches[each].cloneNode(true)), ...names, ` ${texts.join(" / ")}`));
        found.forEach((one, k) => {
          if (one.reason || one.value < low || one.value > high) return;
          plot.append(make("span", { class: "dot", style: `left:${px(one.t)}%;top:${py(one.value)}%;background:${ink(group[k])}` }));
        });
      });
      readout.replaceChildren(...items);
    }

    const follow = (event) => {
      const box = plot.getBoundingClientRect();
      choose(Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)) * data.duration);
    };
    plot.addEventListener("pointermove", follow);
    plot.addEventListener("pointerdown", follow);
    return { paint, point };
  }

  function planPainter(figure, plan) {
    const map = figure.querySelector(".map");
    const [x, y, width, height] = plan.box;
    const margin = 0.02 * Math.max(width, height), size = Math.max(width, height);
    const polyline = (points) => "M" + points.map(([a, b]) => `${a} ${-b}`).join("L");
    const dots = draw("g", {});
    const together = figure.querySelector(".together");

    // At its place, or at the edge nearest to it.
    function cross(a, b, colour) {
      const arm = 0.02 * size;
      const u = Math.min(x + width - arm, Math.max(x + arm, a)), v = Math.min(-y - arm, Math.max(-y - height + arm, b));
      return draw("path", { class: "stop", stroke: colour, d: `M${u - arm} ${v - arm}l${2 * arm} ${2 * arm}m0 ${-2 * arm}l${-2 * arm} ${2 * arm}` });
    }

    function paint() {
      const crosses = draw("g", {});
      const box = [x - margin, -y - height - margin, width + 2 * margin, height + 5 * margin];
      const svg = draw("svg", { viewBox: box.join(" ") });
      svg.append(draw("path", { class: "edge", style: "fill:var(--raised)", d: `${polyline(plan.edge)}Z` }));
      for (const points of plan.lines) svg.append(draw("path", { class: "ground", d: polyline(points) }));
      const groups = findGroups(plan.trails, ["x", "y"], 0.01 * size);
      together.textContent = describeGroups(groups);
      for (const [engine, trail] of Object.entries(plan.trails)) {
        if (hidden.has(Number(engine)) || !trail.t.length) continue;
        svg.append(line(Number(engine), polyline(trail.x.map((a, k) => [a, trail.y[k]])), groups));
        svg.append(draw("circle", { cx: trail.x[0], cy: -trail.y[0], r: 0.013 * size, fill: "none", stroke: ink(engine), "stroke-width": 0.004 * size }));
        if (stop(engine)) crosses.append(cross(trail.x.at(-1), -trail.y.at(-1), ink(engine)));
      }
      const { step } = steps(0, width, 4);
      const foot = -y + 1.2 * margin;
      svg.append(draw("path", { class: "cursor", d: `M${x} ${foot}v${margin / 2}h${step}v${-margin / 2}` }));
      const text = draw("text", { x: x + step + margin / 2, y: foot + margin * 0.8, "font-size": 0.045 * size });
      text.textContent = `${step} m`;
      svg.append(text, dots, crosses);
      map.replaceChildren(svg);
      point();
    }

    function point() {
      dots.replaceChildren();
      for (const [engine, trail] of Object.entries(plan.trails)) {
        if (hidden.has(Number(engine)) || !trail.t.length) continue;
        const k = nearest(trail, now);
        dots.append(draw("circle", { cx: trail.x[k], cy: -trail.y[k], r: 0.011 * size, fill: ink(engine), stroke: "var(--paper)", "stroke-width": 0.003 * size }));
      }
    }
    return { paint, point };
  }

  const slider = document.getElementById("time"), clock = document.getElementById("clock");
  const buttons = [...document.querySelectorAll(".legend button")];

  function choose(t) {
    now = t;
    const text = `${t.toFixed(2)} s`;
    slider.value = data.duration ? (1000 * t) / data.duration : 1000;
    slider.setAttribute("aria-valuetext", text);
    clock.textContent = text;
    painters.forEach((painter) => painter.point());
  }

  function refresh() {
    buttons.forEach((button, engine) => button.setAttribute("aria-pressed", String(!hidden.has(engine))));
    document.querySelectorAll(".swatch").forEach((swatch) => swatch.classList.toggle("off", hidden.has(Number(swatch.dataset.engine))));
    painters.forEach((painter) => painter.paint());
  }

  function remember() {
    const parts = [];
    if (hidden.size) parts.push("hide=" + [...hidden].map((engine) => encodeURIComponent(data.engines[engine])).join(","));
    if (now !== data.duration) parts.push(`t=${now.toFixed(2)}`);
    history.replaceState(null, "", parts.length ? "#" + parts.join("&") : location.pathname + location.search);
  }

  function recall() {
    const view = new URLSearchParams(location.hash.slice(1));
    if (location.hash && !view.has("hide") && !view.has("t")) return; // a link within the page
    hidden.clear();
    for (const name of (view.get("hide") || "").split(",")) {
      const engine = data.engines.indexOf(name);
      if (engine >= 0) hidden.add(engine);
    }
    const t = view.has("t") ? Number(view.get("t")) : data.duration;
    refresh();
    choose(Number.isFinite(t) ? Math.min(data.duration, Math.max(0, t)) : data.duration);
  }

  // The server of `velodrome view --web` says so in the address, and has the viewer beside the page.
  function embed() {
    const place = document.getElementById("viewer");
    if (!place || !location.protocol.startsWith("http") || !new URLSearchParams(location.search).has("replay")) return;
    const recording = encodeURIComponent(new URL("comparison.rrd", location.href).href);
    place.append(make("iframe", { title: "Replay of the ride in the rerun viewer", loading: "lazy", src: `viewer/?url=${recording}&hide_welcome_screen=1&persist=0&notebook=0&theme=dark` }));
    place.hidden = false;
  }

  embed();
  if (!slider) return;
  for (const figure of document.querySelectorAll("figure[data-panel]")) {
    painters.push(panelPainter(figure, data.panels.find((panel) => panel.key === figure.dataset.panel)));
  }
  const map = document.querySelector("figure[data-plan]");
  if (map) painters.push(planPainter(map, data.plan));
  buttons.forEach((button, engine) => button.addEventListener("click", () => {
    if (!hidden.delete(engine)) hidden.add(engine);
    refresh();
    remember();
  }));
  slider.addEventListener("input", () => choose((slider.value / 1000) * data.duration));
  slider.addEventListener("change", remember);
  window.addEventListener("hashchange", recall);
  recall();
})();
