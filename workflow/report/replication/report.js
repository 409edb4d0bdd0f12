"use strict";
{
  // Contents: mark where the reader is.
  const entries = new Map();
  for (const link of document.querySelectorAll(".contents a[href^='#']")) {
    const heading = document.getElementById(link.hash.slice(1));
    if (heading && heading.closest("section")) entries.set(heading.closest("section"), link);
  }
  const inView = new Set();
  const watcher = new IntersectionObserver((changes) => {
    for (const change of changes) inView[change.isIntersecting ? "add" : "delete"](change.target);
    const innermost = [...inView].sort((one, other) => (one.contains(other) ? 1 : -1))[0];
    for (const [section, link] of entries) {
      if (section === innermost) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    }
  }, { rootMargin: "-20% 0px -75% 0px" });
  for (const section of entries.keys()) watcher.observe(section);

  // Details: opened by a link into them, or all at once, for print.
  const reveal = () => {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    let opened = target.hidden;
    target.hidden = false;
    for (let box = target.closest("details"); box; box = box.parentElement.closest("details")) {
      opened ||= !box.open;
      box.open = true;
    }
    if (opened) target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  document.addEventListener("click", (event) => {
    // The same link again leaves the hash as it is.
    const link = event.target.closest("a[href^='#']");
    if (link && link.hash === location.hash) reveal();
  });
  reveal();
  document.getElementById("open").addEventListener("click", () => {
    for (const box of document.querySelectorAll("details")) box.open = true;
  });

  // Claims: those with a verdict, or the main ones, of all papers.
  const filter = document.getElementById("filter");
  const choose = () => {
    const { verdict, main } = filter.elements;
    let shown = 0;
    for (const one of document.querySelectorAll("[data-verdict]")) {
      const { verdict: found, main: isMain } = one.dataset;
      one.hidden = (verdict.value && found !== verdict.value) || (main.checked && isMain === undefined);
      shown += !one.hidden && one.localName === "tr";
    }
    filter.querySelector("output").textContent = `${shown} claims`;
  };
  filter.hidden = false;
  filter.addEventListener("input", choose);
  filter.addEventListener("reset", () => setTimeout(choose));
  for (const link of document.querySelectorAll("a[data-filter]")) {
    link.addEventListener("click", () => {
      filter.elements.verdict.value = link.dataset.filter;
      filter.elements.main.checked = false;
      choose();
    });
  }
  choose();

  // Figures: enlarged in a dialog, moved and scaled by wheel, fingers and keys.
  const dialog = document.getElementById("zoom");
  const stage = dialog.querySelector(".stage");
  const image = dialog.querySelector("img");
  const title = dialog.querySelector(".controls p");
  const most = 16;
  let natural, scale, x, y, opener;

  const show = () => {
    // Its size, not a scale: vectors are drawn again and stay sharp.
    image.style.width = `${natural.width * scale}px`;
    image.style.height = `${natural.height * scale}px`;
    image.style.transform = `translate(${x}px, ${y}px)`;
    dialog.dataset.scale = scale.toFixed(3);
  };
  const least = () => Math.min(stage.clientWidth / natural.width, stage.clientHeight / natural.height);
  const fit = () => {
    scale = least();
    x = (stage.clientWidth - natural.width * scale) / 2;
    y = (stage.clientHeight - natural.height * scale) / 2;
    show();
  };
  const zoom = (factor, atX = stage.clientWidth / 2, atY = stage.clientHeight / 2) => {
    const next = Math.min(Math.max(scale * factor, least() / 2), most);
    x = atX - ((atX - x) * next) / scale;
    y = atY - ((atY - y) * next) / scale;
    scale = next;
    show();
  };
  const move = (dx, dy) => {
    x += dx;
    y += dy;
    show();
  };
  const open = (link) => {
    const shown = link.querySelector("img");
    opener = link;
    natural = { width: shown.width, height: shown.height };
    const size = ["width", "height"].map((name) => Number(shown.getAttribute(name)));
    if (size[0] && size[1]) natural = { width: size[0], height: size[1] };
    image.src = shown.src;
    image.alt = shown.alt;
    title.textContent = link.closest("article").querySelector("h4").firstChild.textContent.trim();
    dialog.showModal();
    fit();
    // On a phone the whole figure is no larger than before: begin at its own size, top left.
    if (scale < 0.8) {
      scale = Math.min(1, stage.clientHeight / natural.height);
      x = 0;
      y = Math.max(0, (stage.clientHeight - natural.height * scale) / 2);
      show();
    }
  };
  const close = () => dialog.close();
  dialog.addEventListener("close", () => {
    image.removeAttribute("src");
    if (opener) opener.focus({ preventScroll: true });
  });
  for (const link of document.querySelectorAll("a.zoom")) {
    link.addEventListener("click", (event) => {
      if (event.metaKey || event.ctrlKey || event.shiftKey) return;
      event.preventDefault();
      open(link);
    });
  }
  const step = 80;
  const actions = { in: () => zoom(1.4), out: () => zoom(1 / 1.4), fit, close };
  const keys = {
    "+": actions.in, "=": actions.in, "-": actions.out, "0": fit,
    ArrowLeft: () => move(step, 0), ArrowRight: () => move(-step, 0),
    ArrowUp: () => move(0, step), ArrowDown: () => move(0, -step),
  };
  dialog.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  });
  dialog.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button) actions[button.dataset.zoom]();
  });
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), event.clientX, event.clientY);
  }, { passive: false });
  stage.addEventListener("dblclick", (event) => {
    if (scale > 1.6 * least()) fit();
    else zoom(2.5, event.clientX, event.clientY);
  });
  const fingers = new Map();
  const span = () => {
    const [one, other] = [...fingers.values()];
    return {
      x: (one.x + other.x) / 2, y: (one.y + other.y) / 2,
      size: Math.hypot(one.x - other.x, one.y - other.y),
    };
  };
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    stage.classList.add("moving");
  });
  stage.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const now = { x: event.clientX, y: event.clientY };
    if (fingers.size === 2) {
      const before = span();
      fingers.set(event.pointerId, now);
      const after = span();
      move(after.x - before.x, after.y - before.y);
      if (before.size > 0) zoom(after.size / before.size, after.x, after.y);
    } else {
      fingers.set(event.pointerId, now);
      if (fingers.size === 1) move(now.x - last.x, now.y - last.y);
    }
  });
  for (const name of ["pointerup", "pointercancel"]) {
    stage.addEventListener(name, (event) => {
      fingers.delete(event.pointerId);
      if (!fingers.size) stage.classList.remove("moving");
    });
  }
  addEventListener("resize", () => dialog.open && fit());
}
