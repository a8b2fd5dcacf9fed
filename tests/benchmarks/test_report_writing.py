"""How long a large page takes to be written, and how large it is."""

import pytest

from frf_ipz.report.page import write_report
from frf_ipz.runs.results import Results
from synthetic_run import Folder, many_frfs


@pytest.mark.benchmark(group="report")
def test_a_page_of_100_frfs_with_50_000_lines(benchmark, tmp_path):
    manifest = {"stages": {"ingest": {}}}
    results = Results(Folder(results={"ingest": many_frfs(100, 50_000)}, manifest=manifest, stale=()))
    path = tmp_path / "report.html"
    benchmark.pedantic(write_report, args=(results, path), rounds=3)
    benchmark.extra_info["megabytes"] = path.stat().st_size / 1e6
    print(f"\nreport.html: {benchmark.extra_info['megabytes']:.1f} MB")
