// Figure of plotly in the colours of the page.
export default {
  template: '<div class="plot" role="figure" :aria-label="label"></div>',
  props: { figure: Object, label: String },
  emits: ["zoom"],
  async mounted() {
    this.scheme = matchMedia("(prefers-color-scheme: dark)");
    this.redraw = () => this.draw();
    this.scheme.addEventListener("change", this.redraw);
    await this.draw();
    if (!this.$el.on) return;
    this.$el.on("plotly_relayout", (event) => {
      if (event["xaxis.autorange"]) this.$emit("zoom", null);
      const low = event["xaxis.range[0]"], high = event["xaxis.range[1]"];
      if (low !== undefined && high !== undefined) this.$emit("zoom", [low, high]);
      if (event["xaxis.range"]) this.$emit("zoom", event["xaxis.range"]);
    });
  },
  updated() { this.draw(); },
  unmounted() {
    this.scheme.removeEventListener("change", this.redraw);
    window.brightgrey.forget(this.$el);
  },
  methods: {
    async draw() { await window.brightgrey.draw(this.$el, this.figure); },
  },
};
