# The archive that the paper's authors published, in place of presses and readings of the virtual sensor.


rule import_published:
    input:
        files=[str(file.path) for file in STUDY.archive.files()],
    output:
        presses=directory(f"{RESULTS}/presses"),
        tactile=directory(f"{RESULTS}/tactile"),
        item_list=f"{RESULTS}/published/items.json",
        inventory=f"{RESULTS}/published/inventory.json",
        counts=f"{RESULTS}/published/counts.csv",
        outliers=f"{RESULTS}/published/outliers.csv",
    log:
        log_of("import_published"),
    benchmark:
        benchmark_of("import_published")
    params:
        code=code("import_published"),
        files=files,
        settings=as_settings(
            **STUDY.values.data.model_dump(mode="json", exclude={"source", "recordings"}),
            models=STUDY.tested,
            sensor=STUDY.sensor,
            seed=STUDY.values.seed,
        ),
    shell:
        run_stage("import_published")
