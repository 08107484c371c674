"""Floor plans and curves drawn as SVG and as pixels."""
