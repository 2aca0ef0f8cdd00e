"""Okabe and Ito's palette (2008), safe for colour-blind readers, and greys for text and lines."""

INK, GREY, PALE = "#1f2328", "#6e7781", "#d8dee4"
BLUE, VERMILLION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
SKY, PURPLE, BLACK = "#56B4E9", "#CC79A7", "#000000"
