"""How long the stages took, from the benchmarks that Snakemake leaves."""

from softtact.reporting.run_record import run_record, run_sentence

HEADER = "s\th:m:s\tmax_rss\tmax_vms\n"


def benchmark(folder, name, seconds, memory):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEADER}{seconds}\t0:00:00\t{memory}\t1.0\n")


def test_jobs_are_summed_by_stage_and_the_last_row_is_all(tmp_path):
    benchmark(tmp_path, "simulate_press/grasps/object_1/elastic.tsv", 2.0, 150.0)
    benchmark(tmp_path, "simulate_press/grasps/object_1/hyperelastic.tsv", 40.0, 600.0)
    benchmark(tmp_path, "evaluate/all.tsv", 5.0, "NA")         # too short to be looked at
    record = run_record(tmp_path)
    assert list(record.stage) == ["evaluate", "simulate_press", "all"]
    assert list(record.jobs) == [1, 2, 3] and list(record.total_s) == [5.0, 42.0, 47.0]
    assert list(record.longest_s) == [5.0, 40.0, 40.0] and record.largest_memory_mb.iloc[-1] == 600.0
    assert "3 jobs of 2 stages took 47 s" in run_sentence(record)


def test_without_benchmarks_it_says_so(tmp_path):
    assert "No job has left a benchmark." in run_sentence(run_record(tmp_path))


def test_a_job_that_was_killed_while_it_wrote_its_benchmark_does_not_count(tmp_path):
    benchmark(tmp_path, "evaluate/all.tsv", 5.0, 150.0)
    for name, written in (("one", ""), ("two", HEADER)):
        (tmp_path / f"evaluate/{name}.tsv").write_text(written)
    assert list(run_record(tmp_path).jobs) == [1, 1]
