"""The page index.html: charts that Plotly draws on the screen, tables, and what stands about them."""
