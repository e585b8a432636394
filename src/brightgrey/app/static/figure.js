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
    window.brightgrey.onZoom(this.$el, (span) => this.$emit("zoom", span));
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
