"""Floor plans, maps and curves drawn as SVG and as pixels."""
