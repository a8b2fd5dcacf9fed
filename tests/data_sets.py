"""Data sets 58 of universal files, written line by line as the format says, not by the package."""

WIDTHS = {2: 13, 4: 20, 5: 13, 6: 20}  # of a number by the type of the ordinates; 5 and 6 are complex
NONE = (0, "NONE", "NONE")
BOTH_ENDS = "      NONE         5   3       NONE         3   3"


def data_set(values, *, axes, kind=4, ends=BOTH_ENDS, ordinate_type=6, start=0.0, step=1.0, number=None):
    """Give one data set; `axes` are those of abscissa, ordinate and denominator: type, label, unit."""
    width = WIDTHS[ordinate_type]
    number = number or (lambda value: f"{value:{width}.{11 if width == 20 else 5}e}")
    head = [f"{kind:5d}         0    0         0 {ends}"]
    head += [f"{ordinate_type:10d}{len(values):10d}         1{start:13.5e}{step:13.5e}{0.0:13.5e}"]
    head += [f"{data_type:>10}    0    0    0 {label:<20s} {unit:<20s}" for data_type, label, unit in (*axes, NONE)]
    parts = [(value.real, value.imag) if ordinate_type > 4 else (value,) for value in values]
    numbers = [number(part) for pair in parts for part in pair]
    per_row = 80 // width
    rows = ["".join(numbers[first : first + per_row]) for first in range(0, len(numbers), per_row)]
    return "\n".join(["    -1", "    58", *["NONE"] * 5, *head, *rows, "    -1", ""])
