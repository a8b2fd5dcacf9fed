"""Files of arrays as other programs write them: MATLAB's version 7.3 by h5py, in MATLAB's layout."""

import h5py
import numpy as np

HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Fri Nov 27 10:00:00 2026 HDF5 schema 1.00 ."


def write_matlab_7_3(path, variables):
    """Write numbers, texts, lists (cells) and dicts (structures) as MATLAB does."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, file, name, value)
    with path.open("r+b") as stream:
        stream.write(HEADER.ljust(124) + b"\x00\x02IM")
    return path


def put(file, group, name, value):
    if isinstance(value, dict):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = np.bytes_("struct")
        for part, content in value.items():
            put(file, inner, part, content)
    elif isinstance(value, str):
        letters = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
        group.create_dataset(name, data=letters).attrs["MATLAB_class"] = np.bytes_("char")
    elif isinstance(value, list):
        cells = file.require_group("#refs#")
        references = []
        for content in value:
            put(file, cells, f"c{len(cells)}", content)
            references.append(cells[f"c{len(cells) - 1}"].ref)
        data = np.array(references, h5py.ref_dtype)[:, None]
        group.create_dataset(name, data=data, dtype=h5py.ref_dtype).attrs["MATLAB_class"] = np.bytes_("cell")
    else:
        values = np.atleast_2d(np.asarray(value)).T
        if np.iscomplexobj(values):
            parts = np.empty(values.shape, [("real", "<f8"), ("imag", "<f8")])
            parts["real"], parts["imag"] = values.real, values.imag
            values = parts
        group.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
