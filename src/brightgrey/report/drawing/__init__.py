"""Drawing of charts: SVG, matplotlib, plotly."""
