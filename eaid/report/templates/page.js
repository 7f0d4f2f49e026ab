// Draws the live plots that stand as JSON in the page, and keeps their colours with the page's light or dark ground.
"use strict";
(function () {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const finger = window.matchMedia("(pointer: coarse)");
  const plots = [];
  function colour(plot) {
    for (const [id, property, light, night] of plot.themed) {
      const model = plot.document.get_model_by_id(id);
      const value = dark.matches ? night : light;
      if (model) model[property] = ["Line", "Text"].includes(model.type) ? { value: value } : value;
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
    const data = JSON.parse(holder.querySelector("script").textContent);
    const place = holder.querySelector(".live-plot");
    holder.classList.add("drawing");
    try {
      const views = await Bokeh.embed.embed_item({ target_id: place.id, root_id: data.root, doc: data.doc });
      const view = Array.isArray(views) ? views[0] : (views.roots || [...views])[0];
      const plot = { document: view.model.document, themed: data.themed };
      plots.push(plot);
      colour(plot);
      if (finger.matches) calm(plot);
      holder.classList.add("drawn");
    } catch (fault) {
      console.error("live plot " + place.id + ": " + fault);
    }
    holder.classList.remove("drawing");
  }
  async function all() {
    if (!window.Bokeh) return;
    for (const holder of document.querySelectorAll(".figure.has-live")) await draw(holder);
    document.documentElement.dataset.ready = "true";
  }
  dark.addEventListener("change", function () { plots.forEach(colour); });
  all();
})();
