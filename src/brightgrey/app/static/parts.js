// Sections of a report: their HTML, cleaned, their figures, and buttons for what the report gives commands for.
export default {
  template: '<div class="parts"></div>',
  props: { content: String, plots: Object, prefix: String, tasks: Object },
  emits: ["zoom", "task"],
  mounted() {
    this.scheme = matchMedia("(prefers-color-scheme: dark)");
    this.redraw = () => this.figures();
    this.scheme.addEventListener("change", this.redraw);
    this.fill();
  },
  updated() { this.fill(); },
  unmounted() {
    this.scheme.removeEventListener("change", this.redraw);
    this.$el.querySelectorAll("[data-plot]").forEach(window.brightgrey.forget);
  },
  methods: {
    fill() {
      if (this.shown !== this.content) {
        this.shown = this.content;
        this.finer = {};
        this.$el.setHTML(this.content);
        for (const element of this.$el.querySelectorAll("[id]")) element.id = this.prefix + element.id;
        for (const table of this.$el.querySelectorAll(".scroll")) {
          table.tabIndex = 0;
          table.setAttribute("role", "region");
          table.setAttribute("aria-label", "Table");
        }
        this.buttons();
      }
      this.figures();
    },
    buttons() {
      for (const item of this.$el.querySelectorAll("[data-task]")) {
        const label = (this.tasks || {})[item.dataset.task];
        if (label === undefined) continue;
        for (const command of item.querySelectorAll(".command")) command.remove();
        if (!label) { item.remove(); continue; }
        const button = document.createElement("button");
        button.type = "button";
        button.className = "button small";
        button.dataset.key = `step-${item.dataset.task}`;
        button.textContent = label;
        button.addEventListener("click", () => this.$emit("task", item.dataset.task));
        item.append(" ", button);
      }
      if (this.tasks) for (const command of this.$el.querySelectorAll("p.command")) command.remove();
    },
    async figures() {
      for (const element of this.$el.querySelectorAll("[data-plot]")) {
        const name = element.dataset.plot;
        await window.brightgrey.draw(element, this.finer[name] || this.plots[name]);
        window.brightgrey.onZoom(element, (span) => this.$emit("zoom", { plot: name, span }));
      }
    },
    show(name, figure) {
      this.finer[name] = figure;
      for (const element of this.$el.querySelectorAll(`[data-plot="${CSS.escape(name)}"]`))
        window.brightgrey.draw(element, figure);
    },
  },
};
