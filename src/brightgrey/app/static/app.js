"use strict";
// What NiceGUI does not do: figures in the page's colours, uploads with progress, copying, and the focus that stays.
window.brightgrey = (function () {
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  let loading = null;

  function plotly() {
    if (window.Plotly) return Promise.resolve();
    loading ??= new Promise((resolve, reject) => {
      const script = document.createElement("script");
      script.src = "/static/plotly.js";
      script.onload = resolve;
      script.onerror = reject;
      document.head.append(script);
    });
    return loading;
  }

  function coloured(value, style) {
    if (typeof value === "string") {
      const name = /^var\((--[a-z-]+)\)$/.exec(value);
      return name ? style.getPropertyValue(name[1]).trim() : value;
    }
    if (Array.isArray(value)) return typeof value[0] === "number" ? value : value.map((v) => coloured(v, style));
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, coloured(v, style)]));
  }

  async function draw(element, figure) {
    if (!figure) return;
    await plotly();
    if (!element.isConnected) return;
    const { data, layout } = coloured(JSON.parse(JSON.stringify(figure)), getComputedStyle(document.documentElement));
    await window.Plotly.react(element, data, layout, config);
  }

  // Tells which part of the axis of time is chosen, whichever panel it was chosen in; null for all of it.
  function onZoom(element, tell) {
    if (!element.on || element.tellsZoom) return;
    element.tellsZoom = true;
    element.on("plotly_relayout", (event) => {
      for (const [key, value] of Object.entries(event)) {
        if (/^xaxis\d*\.autorange$/.test(key) && value) return tell(null);
        if (/^xaxis\d*\.range$/.test(key)) return tell(value);
        if (/^xaxis\d*\.range\[0\]$/.test(key)) return tell([value, event[key.replace("[0]", "[1]")]]);
      }
    });
  }

  function forget(element) {
    if (window.Plotly) window.Plotly.purge(element);
  }

  // Uploads: one after the other, with a line for each; the server refuses what it cannot use and says why.
  function line(list, text, kind) {
    const item = document.createElement("li");
    item.className = kind || "";
    item.textContent = text;
    list.append(item);
    return item;
  }

  function send(file, project, list) {
    return new Promise((resolve) => {
      const item = line(list, `${file.name}: 0 %`);
      const request = new XMLHttpRequest();
      request.open("POST", `/upload/${project}`);
      request.setRequestHeader("X-File-Name", encodeURIComponent(file.name));
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.onprogress = (event) => {
        const part = event.total ? Math.floor((100 * event.loaded) / event.total) : 100;
        item.textContent = part < 100 ? `${file.name}: ${part} %` : `${file.name}: being read …`;
      };
      request.onload = () => {
        let answer = {};
        try { answer = JSON.parse(request.responseText); } catch { answer = {}; }
        if (request.status === 200) item.remove();
        else {
          item.className = "wrong";
          item.textContent = `${file.name}: ${answer.problem || "the upload was refused"}`;
        }
        resolve();
      };
      request.onerror = () => {
        item.className = "wrong";
        item.textContent = `${file.name}: the connection was closed; is the app still running?`;
        resolve();
      };
      request.send(file);
    });
  }

  async function upload(files, element) {
    const list = document.getElementById("uploads");
    list.replaceChildren();
    for (const file of files) await send(file, element.dataset.project, list);
  }

  document.addEventListener("change", (event) => {
    const input = event.target.closest("input[type=file][data-project]");
    if (!input) return;
    upload([...input.files], input).then(() => { input.value = ""; });
  });
  for (const name of ["dragenter", "dragover"])
    document.addEventListener(name, (event) => {
      const zone = event.target.closest && event.target.closest("[data-drop]");
      event.preventDefault();
      if (zone) zone.classList.add("over");
    });
  document.addEventListener("dragleave", (event) => {
    const zone = event.target.closest && event.target.closest("[data-drop]");
    if (zone && !zone.contains(event.relatedTarget)) zone.classList.remove("over");
  });
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    const zone = event.target.closest && event.target.closest("[data-drop]");
    if (!zone) return;
    zone.classList.remove("over");
    upload([...event.dataTransfer.files], zone.querySelector("input[type=file]"));
  });

  document.addEventListener("click", async (event) => {
    const button = event.target.closest("[data-copy]");
    if (!button) return;
    const text = document.getElementById(button.dataset.copy).textContent;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const range = document.createRange();
      range.selectNodeContents(document.getElementById(button.dataset.copy));
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      document.execCommand("copy");
    }
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = "Copy"; }, 1500);
  });

  // What was unfolded stays so when it is made anew.
  const unfolded = new Set();
  const titleOf = (details) => (details.querySelector("summary") || details).textContent;
  document.addEventListener("toggle", (event) => {
    if (event.target.tagName !== "DETAILS") return;
    if (event.target.open) unfolded.add(titleOf(event.target));
    else unfolded.delete(titleOf(event.target));
  }, true);
  new MutationObserver((changes) => {
    for (const change of changes)
      for (const node of change.addedNodes) {
        if (node.nodeType !== 1) continue;
        for (const details of [node, ...node.querySelectorAll("details")])
          if (details.tagName === "DETAILS" && unfolded.has(titleOf(details))) details.open = true;
      }
  }).observe(document.documentElement, { childList: true, subtree: true });

  // What is chosen in a field or by a button goes to the server by the key of the field, which may be made anew there
  // meanwhile. While a button of the mouse is down it waits: the answer would change the page below the pointer.
  let pressed = false, waiting = [];
  function tell(key, value) {
    const shown = document.querySelector("[data-scene]");
    waiting.push([key, value, shown ? shown.dataset.scene : ""]);
    if (!pressed) release();
  }
  function release() {
    pressed = false;
    for (const said of waiting.splice(0)) window.emitEvent("control", said);
  }
  document.addEventListener("pointerdown", () => { pressed = true; }, true);
  for (const name of ["pointerup", "pointercancel", "keydown"]) document.addEventListener(name, release, true);
  document.addEventListener("pointermove", (event) => { if (pressed && !event.buttons) release(); }, true);
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[type=button][data-key]");
    if (button && !button.disabled) tell(button.dataset.key, null);
  });
  document.addEventListener("change", ({ target }) => {
    if (!target.dataset.key || target.type === "file") return;
    if (target.tagName === "SELECT") pressed = false;  // the list that opens may keep the button's release to itself
    if (typed && typed.key === target.dataset.key) typed.told = true;
    tell(target.dataset.key, target.type === "checkbox" ? target.checked : target.value);
  });

  // A part of the page that is made anew gives the focus back to the element with the same key, with what was typed.
  let last = null, typed = null;
  const withKey = (key) => document.querySelector(`[data-key="${CSS.escape(key)}"]`);
  document.addEventListener("focusin", (event) => { last = event.target.dataset ? event.target.dataset.key : null; });
  document.addEventListener("input", ({ target }) => {
    if (target.matches("input[data-key]:not([type])"))
      typed = { key: target.dataset.key, text: target.value, at: target.selectionStart, told: false };
  });
  document.addEventListener("focusout", () => setTimeout(() => {
    const field = typed && withKey(typed.key);
    if (!field || field === document.activeElement) return;  // it is being made anew, or has been
    const { key, text, told } = typed;
    typed = null;
    if (!told) tell(key, text);  // a text that was put back is no change for the browser
  }));
  new MutationObserver(() => {
    if (!last || document.activeElement !== document.body) return;
    const again = withKey(last);
    if (!again) return;
    again.focus({ preventScroll: true });
    if (!typed || typed.key !== last) return;
    again.value = typed.text;
    again.setSelectionRange(typed.at, typed.at);
  }).observe(document.documentElement, { childList: true, subtree: true });
  document.addEventListener("pointerdown", (event) => {
    if (!event.target.closest("[data-key]")) last = null;
  });

  // A stage was opened: its address, the top of the page, and the title for those who hear it.
  function arrive(address) {
    if (location.pathname !== address) history.pushState({}, "", address);
    unfolded.clear();
    scrollTo(0, 0);
    const content = document.getElementById("content");
    if (content) content.focus({ preventScroll: true });
  }
  addEventListener("popstate", () => location.reload());

  return { arrive, draw, forget, onZoom, plotly };
})();
