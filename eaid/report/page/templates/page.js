// Draws the live plots that stand as JSON in the page when they come into view, keeps their colours with the page's
// ground, and copies commands.
"use strict";
(function () {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const finger = window.matchMedia("(pointer: coarse)");
  const plots = [];
  function colour(plot) {
    for (const [id, property, light, night] of plot.themed) {
      const model = plot.document.get_model_by_id(id);
      const value = dark.matches ? night : light;
      if (model) model[property] = property.includes("_alpha") || !model.type.match(/^(Line|Text|Scatter|VArea|TeeHead|Whisker)$/) ? value : { value: value };
    }
  }
  function calm(plot) {
    // A finger that scrolls the page must not be caught by a plot.
    for (const [id] of plot.themed) {
      const model = plot.document.get_model_by_id(id);
      for (const tool of (model && model.toolbar && model.toolbar.tools) || [])
        if (["PanTool", "BoxZoomTool"].includes(tool.type)) tool.active = false;
    }
  }
  async function draw(holder) {
    if (holder.dataset.begun) return;
    holder.dataset.begun = "true";
    const figure = holder.closest(".figure");
    const data = JSON.parse(holder.querySelector("script").textContent);
    const place = holder.querySelector(".live-plot");
    figure.classList.add("drawing");
    try {
      const views = await Bokeh.embed.embed_item({ target_id: place.id, root_id: data.root, doc: data.doc });
      const view = Array.isArray(views) ? views[0] : (views.roots || [...views])[0];
      const plot = { document: view.model.document, themed: data.themed };
      plots.push(plot);
      colour(plot);
      if (finger.matches) calm(plot);
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
  dark.addEventListener("change", function () { plots.forEach(colour); });
  window.addEventListener("hashchange", unfold);
  copying();
  unfold();
  within(document).then(function () { document.documentElement.dataset.ready = "true"; });
})();
