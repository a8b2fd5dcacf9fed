"""A solid and a shell model for CalculiX, in mm, t and s; what it computes, and what it exports."""

import re
import subprocess

MATERIAL = "*MATERIAL, NAME=AL\n*ELASTIC\n70000.0, 0.33\n*DENSITY\n2.7e-9\n"
ROW_OF_EIGENVALUES = re.compile(r"^ +\d+ +\S+E\S+ +\S+E\S+ +(\S+E\S+) +\S+E\S+ *$")


def _deck(sizes_mm, counts, element, section, held):
    n_x, n_y, n_z = counts

    def node(i, j, k):
        return 1 + i + (n_x + 1) * (j + (n_y + 1) * k)

    lines = ["*NODE, NSET=ALL"]
    for k in range(n_z + 1):
        for j in range(n_y + 1):
            for i in range(n_x + 1):
                places = zip(sizes_mm, (i, j, k), counts, strict=True)
                x, y, z = (size * place / max(count, 1) for size, place, count in places)
                lines.append(f"{node(i, j, k)}, {x}, {y}, {z}")
    lines.append(f"*ELEMENT, TYPE={element}, ELSET=EALL")
    number = 0
    for k in range(max(n_z, 1)):
        for j in range(n_y):
            for i in range(n_x):
                number += 1
                corners = [
                    node(i + a, j + b, k + c)
                    for c in ((0, 1) if n_z else (0,))
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))
                ]
                lines.append(", ".join(map(str, (number, *corners))))
    root = ", ".join(str(node(0, j, k)) for j in range(n_y + 1) for k in range(n_z + 1))
    lines += ["*NSET, NSET=ROOT", root, MATERIAL + section, "*BOUNDARY", held]
    return "\n".join(lines) + "\n"


SOLID = _deck((60.0, 10.0, 4.0), (6, 2, 1), "C3D8", "*SOLID SECTION, ELSET=EALL, MATERIAL=AL", "ROOT, 1, 3")
SHELL = _deck((60.0, 20.0, 0.0), (6, 3, 0), "S4", "*SHELL SECTION, ELSET=EALL, MATERIAL=AL\n2.0", "ROOT, 1, 6")


def run_calculix(folder, deck, n_modes=8):
    """Export ``job.sti``, ``job.mas`` and ``job.dof``; give the frequencies that CalculiX finds itself, Hz."""
    for job, keyword in (("own", ""), ("job", ", SOLVER=MATRIXSTORAGE")):
        step = f"*STEP\n*FREQUENCY{keyword}\n{n_modes}\n*END STEP\n"
        (folder / f"{job}.inp").write_text(deck + step)
        subprocess.run(["ccx", "-i", job], cwd=folder, check=False, capture_output=True, timeout=120)
    text = (folder / "own.dat").read_text()
    rows = [match for match in map(ROW_OF_EIGENVALUES.match, text.splitlines()) if match]
    return [float(match[1]) for match in rows[:n_modes]]
