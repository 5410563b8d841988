"""The page index.html: charts that Plotly draws on the screen, tables, and words about them."""
