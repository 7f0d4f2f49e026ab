// Draws the live plots that stand as JSON in the page when they come into view, and copies commands.
"use strict";
(function () {
  const finger = window.matchMedia("(pointer: coarse)");
  function calm(root) {
    // A finger that scrolls the page must not be caught by a plot.
    for (const panel of root.children || [root])
      for (const tool of panel.toolbar.tools) if (["PanTool", "BoxZoomTool"].includes(tool.type)) tool.active = false;
  }
  function oneMinus() {
    // Tooltips write a negative number as axes and tables do.
    const forms = Bokeh.require("core/util/templating").DEFAULT_FORMATTERS, written = forms.numeral;
    forms.numeral = function (value, form) { return written(value, form).replace("-", "−"); };
  }
  async function draw(holder) {
    if (holder.dataset.begun) return;
    holder.dataset.begun = "true";
    const figure = holder.closest(".figure");
    const data = JSON.parse(holder.querySelector("script").textContent);
    const place = holder.querySelector(".live-plot");
    figure.classList.add("drawing");
    try {
      const views = await Bokeh.embed.embed_item({ target_id: place.id, root_id: data.root.id, doc: data.doc });
      const view = Array.isArray(views) ? views[0] : (views.roots || [...views])[0];
      if (finger.matches) calm(view.model);
      figure.classList.add("drawn");
    } catch (fault) {
      console.error("live plot " + place.id + ": " + fault);
    }
    figure.classList.remove("drawing");
  }
  async function within(root) {
    if (!window.Bokeh) return;
    for (const holder of root.querySelectorAll(".live"))
      if (!holder.closest("details:not([open])")) await draw(holder);
  }
  function copying() {
    for (const button of document.querySelectorAll("button.copy")) {
      button.hidden = false;
      button.addEventListener("click", async function () {
        const code = button.parentElement.querySelector("code");
        try {
          await navigator.clipboard.writeText(code.textContent);
        } catch (fault) {
          const range = document.createRange();
          range.selectNodeContents(code);
          getSelection().removeAllRanges();
          getSelection().addRange(range);
          document.execCommand("copy");
        }
        button.textContent = "Copied";
        setTimeout(function () { button.textContent = "Copy"; }, 1500);
      });
    }
  }
  function unfold() {
    // A link to what is folded opens it.
    const aim = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let fold = aim && aim.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  }
  for (const fold of document.querySelectorAll("details")) fold.addEventListener("toggle", function () { if (fold.open) within(fold); });
  window.addEventListener("hashchange", unfold);
  if (window.Bokeh) oneMinus();
  copying();
  unfold();
  within(document).then(function () { document.documentElement.dataset.ready = "true"; });
})();
