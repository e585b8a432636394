// Sections of a report: their HTML, cleaned, and their figures.
export default {
  template: '<div class="parts"></div>',
  props: { content: String, plots: Object, prefix: String },
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
        this.$el.setHTML(this.content);
        for (const element of this.$el.querySelectorAll("[id]")) element.id = this.prefix + element.id;
        for (const table of this.$el.querySelectorAll(".scroll")) {
          table.tabIndex = 0;
          table.setAttribute("role", "region");
          table.setAttribute("aria-label", "Table");
        }
      }
      this.figures();
    },
    figures() {
      for (const element of this.$el.querySelectorAll("[data-plot]"))
        window.brightgrey.draw(element, this.plots[element.dataset.plot]);
    },
  },
};
