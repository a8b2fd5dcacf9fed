"""Every number of a Matrix Market file is read whole, or refused with its line; conventions are recognised and said."""

import bz2
import gzip

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import io, sparse

from frf_ipz.errors import FileFormatError
from frf_ipz.fe.matrices.formats import matrix_market
from frf_ipz.fe.matrices.formats.matrix_market import read_matrix_market
from frf_ipz.fe.matrices.stored import MatrixRequest

REAL = "%%MatrixMarket matrix coordinate real symmetric\n"
GENERAL = "%%MatrixMarket matrix coordinate real general\n"
MATRIX = np.array([[1300.5, -800.0, 0.0], [-800.0, 900.25, -100.125], [0.0, -100.125, 100.125]])
LOWER = "1 1 1300.5\n2 1 -800\n2 2 900.25\n3 2 -100.125\n3 3 100.125\n"
UPPER = "1 1 1300.5\n1 2 -800\n2 2 900.25\n2 3 -100.125\n3 3 100.125\n"
BOTH = "1 1 1300.5\n2 1 -800\n1 2 -800\n2 2 900.25\n3 2 -100.125\n2 3 -100.125\n3 3 100.125\n"
COLUMNS = ["1300.5", "-800", "0", "-800", "900.25", "-100.125", "0", "-100.125", "100.125"]
COMPLEX = LOWER.replace("\n", " 0.0\n")


def read(folder, text, order=3):
    path = folder / "K.mtx"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_matrix_market(MatrixRequest(path=path, what="stiffness", order=order, ordered_by="dofs.csv"))


def refused(folder, text, order=3):
    with pytest.raises(FileFormatError) as caught:
        read(folder, text, order)
    return str(caught.value)


PLAIN = {
    "plain": REAL + "3 3 5\n" + LOWER,
    "upper triangle": REAL + "3 3 5\n" + UPPER,
    "any order of entries": REAL + "3 3 5\n" + "\n".join(sorted(LOWER.splitlines(), reverse=True)),
    "D exponents": REAL + "3 3 5\n" + LOWER.replace("-800", "-8.0D+02").replace("1300.5", "1.3005d3"),
    "exponents without a letter": REAL + "3 3 5\n" + LOWER.replace("1300.5", "1.3005+3").replace("-800", "-8.0+2"),
    "Q exponents": REAL + "3 3 5\n" + LOWER.replace("-800", "-8.0Q2"),
    "blanks and tabs": REAL + "  3\t3   5 \n" + LOWER.replace(" ", " \t ").replace("\n", "  \n"),
    "blank lines": REAL + "\n\n3 3 5\n\n" + LOWER.replace("\n", "\n\n"),
    "comments": REAL + "% of a beam\n%\n3 3 5\n" + LOWER.replace("2 2", "% second row: 1,5\n2 2"),
    "CR LF": (REAL + "3 3 5\n" + LOWER).replace("\n", "\r\n"),
    "CR only": (REAL + "3 3 5\n" + LOWER).replace("\n", "\r"),
    "no end of the last line": (REAL + "3 3 5\n" + LOWER).rstrip(),
    "byte order mark": "\ufeff" + REAL + "3 3 5\n" + LOWER,
    "capitals": REAL.upper().replace("MATRIXMARKET", "MatrixMarket") + "3 3 5\n" + LOWER,
    "double": REAL.replace("real", "double") + "3 3 5\n" + LOWER,
    "one per cent sign": REAL[1:] + "3 3 5\n" + LOWER,
    "points at the ends": REAL + "3 3 5\n" + LOWER.replace("-800", "-800."),
    "general": GENERAL + "3 3 7\n" + BOTH,
    "complex without imaginary parts": REAL.replace("real", "complex") + "3 3 5\n" + COMPLEX,
    "hermitian without imaginary parts": REAL.replace("real symmetric", "complex hermitian") + "3 3 5\n" + COMPLEX,
    "array": "%%MatrixMarket matrix array real general\n3 3\n" + "\n".join(COLUMNS),
    "array in rows": "%%MatrixMarket matrix array real general\n3 3\n" + " ".join(COLUMNS),
    "array of a triangle": "%%MatrixMarket matrix array real symmetric\n3 3\n"
    + "\n".join(COLUMNS[place] for place in (0, 1, 2, 4, 5, 8)),
    "array of a triangle with D": "%%MatrixMarket matrix array real symmetric\n3 3\n"
    "1.3005D3\n-800\n0\n900.25\n-100.125\n100.125",
    "array of complex": "%%MatrixMarket matrix array complex general\n3 3\n" + "\n".join(f"{v} 0" for v in COLUMNS),
    "gzip": gzip.compress((REAL + "3 3 5\n" + LOWER).encode()),
    "bzip2": bz2.compress((REAL + "3 3 5\n" + LOWER).encode()),
}
SAID = {
    "both triangles under symmetric": (REAL + "3 3 7\n" + BOTH, "each entry counts once"),
    "one entry in both": (REAL + "3 3 6\n" + LOWER + "1 2 -800\n", "each entry counts once"),
    "array of both under symmetric": (
        "%%MatrixMarket matrix array real symmetric\n3 3\n" + "\n".join(COLUMNS),
        "each entry counts once",
    ),
    "upper under general": (GENERAL + "3 3 5\n" + UPPER, "only the upper triangle"),
    "lower under general": (GENERAL + "3 3 5\n" + LOWER, "only the lower triangle"),
    "lower as a general array": (
        "%%MatrixMarket matrix array real general\n3 3\n1300.5 -800 0 0 900.25 -100.125 0 0 100.125\n",
        "only the lower triangle",
    ),
    "an entry in two shares": (REAL + "3 3 6\n" + LOWER.replace("900.25", "900") + "2 2 0.25\n", "added up"),
}


@pytest.mark.parametrize("text", PLAIN.values(), ids=PLAIN)
def test_a_matrix_is_read_whole(tmp_path, text):
    file = read(tmp_path, text)
    assert_array_equal(file.matrix.toarray(), MATRIX)
    assert file.notes == ()


@pytest.mark.parametrize(("text", "words"), SAID.values(), ids=SAID)
def test_another_convention_is_recognised_and_said(tmp_path, text, words):
    file = read(tmp_path, text)
    assert_array_equal(file.matrix.toarray(), MATRIX)
    assert len(file.notes) == 1
    assert words in file.notes[0]


REFUSED = {
    "decimal comma": (LOWER.replace("1300.5", "1300,5"), ["line 3", "'1300,5'", "decimal comma"]),
    "thousands": (LOWER.replace("1300.5", "1,300.5"), ["line 3", "'1,300.5'", "thousands"]),
    "blank in a number": (LOWER.replace("1300.5", "1 300.5"), ["line 3", "4 columns"]),
    "text behind": (LOWER.replace("1300.5", "1300.5N/m"), ["line 3", "'1300.5N/m'"]),
    "two points": (LOWER.replace("900.25", "900.25.1"), ["line 5", "'900.25.1'"]),
    "cut exponent": (LOWER.replace("900.25", "9.0025E"), ["line 5", "'9.0025E'"]),
    "underscore": (LOWER.replace("1300.5", "1_300.5"), ["line 3", "'1_300.5'"]),
    "hexadecimal": (LOWER.replace("1300.5", "0x514"), ["line 3", "hexadecimal"]),
    "NaN": (LOWER.replace("1300.5", "nan"), ["line 3", "no finite number"]),
    "too large": (LOWER.replace("1300.5", "1e999"), ["line 3", "double precision"]),
    "1e300": (LOWER.replace("1300.5", "1e300"), ["row 1", "no structure"]),
    "missing value": (LOWER.replace(" 1300.5", ""), ["line 3", "2 columns"]),
    "row 0": (LOWER.replace("1 1", "0 0"), ["line 3", "count from 1"]),
    "row beyond": (LOWER.replace("3 3", "4 4"), ["line 7", "of 3 rows"]),
    "row with a point": (LOWER.replace("3 3", "3. 3."), ["line 7", "'3.' is no number of a row"]),
    "negative row": (LOWER.replace("3 3", "-3 3"), ["line 7", "'-3' is no number of a row"]),
    "huge row": (LOWER.replace("3 3", "99999999999999999999 3"), ["line 7", "of 3 rows"]),
    "line missing": (LOWER.replace("2 1 -800\n", ""), ["line 2", "5 entries", "4 follow"]),
    "line too many": (LOWER + "3 1 4.0\n", ["line 2", "5 entries", "6 follow"]),
    "NUL": (LOWER.replace("900", "9\0"), ["NUL"]),
}


@pytest.mark.parametrize(("entries", "words"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_entry_is_refused_with_its_line(tmp_path, entries, words):
    message = refused(tmp_path, REAL + "3 3 5\n" + entries)
    assert str(tmp_path / "K.mtx") in message
    for word in words:
        assert word in message


HEADERS = {
    "empty": ("", ["line 1", "begins with"]),
    "another file": ("node,direction\n1,x\n", ["line 1", "begins with"]),
    "UTF-16": ((REAL + "3 3 5\n" + LOWER).encode("utf-16"), ["NUL", "UTF-16"]),
    "vector": (REAL.replace("matrix c", "vector c"), ["line 1", "'vector'"]),
    "format": (REAL.replace("coordinate", "coordinates"), ["line 1", "did you mean 'coordinate'"]),
    "symmetry": (REAL.replace("symmetric", "symetric"), ["line 1", "did you mean 'symmetric'"]),
    "no symmetry": (REAL.replace(" symmetric", ""), ["line 1", "names no symmetry"]),
    "a word more": (REAL.replace("symmetric", "symmetric positive"), ["'positive'"]),
    "no size": (REAL + "% nothing\n", ["0 numbers"]),
    "size of an array": (REAL + "3 3\n" + LOWER, ["line 2", "number of entries"]),
    "size that is none": (REAL + "3 x 5\n" + LOWER, ["line 2", "'3 x 5' is no size"]),
    "two thousand million rows": (REAL + "2000000000 2000000000 5\n" + LOWER, ["2000000000", "dofs.csv names 3"]),
    "announced entries without end": (REAL + "3 3 4000000000000\n" + LOWER, ["4000000000000 entries", "5 follow"]),
    "pattern": (REAL.replace("real", "pattern") + "3 3 1\n1 1\n", ["pattern"]),
    "fractions under integer": (REAL.replace("real", "integer") + "3 3 5\n" + LOWER, ["fractions"]),
    "skew": (
        REAL.replace("symmetric", "skew-symmetric") + "3 3 1\n2 1 -800\n",
        ["no stiffness is", "gyroscopic", "export it again"],
    ),
    "skew with a diagonal": (
        REAL.replace("symmetric", "skew-symmetric") + "3 3 5\n" + LOWER,
        ["its diagonal is not zero", "write symmetric in that line"],
    ),
    "hermitian with imaginary parts": (
        REAL.replace("real symmetric", "complex hermitian")
        + "3 3 5\n"
        + "\n".join(f"{line} {0.02 * float(line.split()[2])}" for line in LOWER.splitlines()),
        ["hermitian", "is symmetric"],
    ),
    "triangles that differ": (
        REAL + "3 3 7\n" + BOTH.replace("1 2 -800", "1 2 -900"),
        ["-900 in row 1, column 2", "-800 in row 2"],
    ),
    "array of another size": ("%%MatrixMarket matrix array real symmetric\n3 3\n1\n2\n", ["9 or 6", "2 follow"]),
    "gzip cut off": (gzip.compress((REAL + "3 3 5\n" + LOWER).encode())[:-20], ["decompressed"]),
}


@pytest.mark.parametrize(("text", "words"), HEADERS.values(), ids=HEADERS)
def test_a_file_of_another_kind_is_refused(tmp_path, text, words):
    message = refused(tmp_path, text)
    for word in words:
        assert word in message


def test_an_explicit_zero_says_that_a_matrix_is_no_half(tmp_path):
    file = read(tmp_path, GENERAL + "2 2 4\n1 1 2e6\n2 1 -1e6\n1 2 0\n2 2 2e6\n", 2)
    assert_array_equal(file.matrix.toarray(), [[2e6, 0.0], [-1e6, 2e6]])


def test_a_large_file_is_read_by_scipy_alone(tmp_path, monkeypatch):
    """Line by line, a file of 100 MB would take minutes."""
    rng = np.random.default_rng(3)
    half = sparse.random_array((400, 400), density=0.02, rng=rng)
    matrix = half + half.T
    io.mmwrite(tmp_path / "K.mtx", sparse.coo_array(matrix), symmetry="symmetric", precision=17)
    monkeypatch.setattr(matrix_market, "_parse_lines", None)
    read_back = read_matrix_market(
        MatrixRequest(path=tmp_path / "K.mtx", what="stiffness", order=400, ordered_by="dofs.csv")
    ).matrix
    assert_array_equal(read_back.toarray(), matrix.toarray())
