"""What every page and figure is made with: tables, style, figures, pages, model cards."""
